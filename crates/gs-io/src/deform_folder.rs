//! Model folders with `deform/iteration_N/deform.pth` next to
//! `point_cloud/iteration_N/point_cloud.ply`: the layout of Deformable-3D-Gaussians, SC-GS, Grid4D
//! and DASH.

use crate::cfg_args::{self, CfgArgs, Value};
use crate::error::IoError;
use crate::fs::text;
use crate::fs::{list_names, read_bytes};
use crate::model_folder;
use crate::open_options::OpenOptions;
use crate::ply;
use crate::repair::{self, RepairReport};
use gs_core::Splats;
use std::io::Read;
use std::path::{Path, PathBuf};

/// File name of the network.
const NETWORK: &str = "deform.pth";
/// Folder of saved networks.
const SAVES: &str = "deform";
/// Number of bytes at the start of the file that are searched for tensor
/// names; the pickle comes first and takes a few KiB.
const HEAD: u64 = 1 << 18;

/// Method that trained a folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Method {
    Deformable3dgs,
    Scgs,
    Grid4d,
    Dash,
}

/// Names in the network's file that identify the methods; the first one found is used.
const MARKS: [(&str, Method); 5] = [
    ("xyzt_encoding", Method::Dash),
    ("d4_mlp", Method::Dash),
    ("xyt_encoding", Method::Grid4d),
    ("temporal_mlp", Method::Grid4d),
    ("_node_radius", Method::Scgs),
];

/// The method that trained a folder or the iteration in it; `None` if it has a different layout.
pub(crate) fn method_of(dir: &Path) -> Option<Method> {
    let iteration = model_folder::find(dir, None).ok();
    let model = iteration.as_ref().map_or(dir, |iteration| &iteration.model);
    if let Ok((_, network)) = network_of(model, None) {
        let mut head = Vec::new();
        let file = crate::fs::open_file(&network).ok()?;
        file.take(HEAD).read_to_end(&mut head).ok()?;
        let has = |mark: &str| head.windows(mark.len()).any(|window| window == mark.as_bytes());
        let found = MARKS.iter().find(|(mark, _)| has(mark)).map(|(_, method)| *method);
        return Some(found.unwrap_or(Method::Deformable3dgs));
    }
    // Without the network, its folder or the training settings identify the method.
    let ply = iteration.as_ref()?.dir.join("point_cloud.ply");
    let cfg = read_cfg(model).ok().flatten().map(|(cfg, _)| cfg);
    let set = |name: &str| cfg.as_ref().is_some_and(|cfg| cfg.get(name).is_some());
    let is_column = |wanted: &str| {
        let layout = ply::read_header_file(&ply).ok()?.gaussians().ok()?;
        Some(layout.extra_columns.iter().any(|column| column == wanted))
    };
    let has_column = |name: &str| is_column(name).unwrap_or(false);
    if set("grid_args") {
        return Some(if has_column("dynamic") { Method::Dash } else { Method::Grid4d });
    }
    if has_column("fea_0") || set("deform_type") {
        return Some(Method::Scgs);
    }
    (set("is_6dof") || model.join(SAVES).is_dir()).then_some(Method::Deformable3dgs)
}

/// The newest saved network and its number, or that of the requested iteration.
fn network_of(model: &Path, wanted: Option<u64>) -> Result<(u64, PathBuf), IoError> {
    let saves = model.join(SAVES);
    let missing = || {
        IoError::content(
            &saves,
            format!(
                "contains no iteration_N/{NETWORK}, without which the model cannot move; copy the \
                folder `{SAVES}` from the machine that trained the model"
            ),
        )
    };
    if !saves.is_dir() {
        return Err(missing());
    }
    let number = |name: &str| name.strip_prefix("iteration_")?.parse::<u64>().ok();
    let mut found: Vec<(u64, PathBuf)> = list_names(&saves)?
        .iter()
        .filter_map(|name| Some((number(name)?, saves.join(name).join(NETWORK))))
        .filter(|(_, path)| path.is_file())
        .collect();
    found.sort();
    let requested = found.iter().position(|(number, _)| Some(*number) == wanted);
    let newest = found.len().checked_sub(1).ok_or_else(missing)?;
    Ok(found.swap_remove(requested.unwrap_or(newest)))
}

/// `cfg_args` of a folder and its path, if there is one.
fn read_cfg(model: &Path) -> Result<Option<(CfgArgs, PathBuf)>, IoError> {
    let path = model.join("cfg_args");
    if !path.is_file() {
        return Ok(None);
    }
    match cfg_args::parse(&text::decode(&read_bytes(&path)?)) {
        Ok(cfg) => Ok(Some((cfg, path))),
        Err(source) => Err(IoError::format(&path)(source)),
    }
}

/// The parts common to all these methods.
#[derive(Debug)]
pub(crate) struct DeformFolder {
    /// Undamaged splats.
    pub(crate) splats: Splats,
    pub(crate) repair: RepairReport,
    /// The requested columns, `[columns][N]`.
    pub(crate) columns: Vec<Vec<f32>>,
    pub(crate) network: PathBuf,
    pub(crate) cfg: CfgArgs,
    pub(crate) facts: Vec<(&'static str, String)>,
    pub(crate) notes: Vec<String>,
    pub(crate) files: Vec<PathBuf>,
}

impl DeformFolder {
    /// Reads all parts except the network. `columns` selects further
    /// columns of the PLY from its extra ones.
    pub(crate) fn read(
        dir: &Path,
        options: &OpenOptions,
        columns: impl FnOnce(&[String]) -> Vec<String>,
    ) -> Result<Self, IoError> {
        let iteration = model_folder::find(dir, options.iteration)?;
        let (number, network) = network_of(&iteration.model, options.iteration)?;
        let ply_path = iteration.dir.join("point_cloud.ply");
        let bytes = read_bytes(&ply_path)?;
        let read = ply::read(&bytes).map_err(IoError::format(&ply_path))?;
        let names = columns(&read.extra_columns);
        let mut columns = ply::read_columns(&bytes, &names).map_err(IoError::format(&ply_path))?;
        let broken = |row: usize| columns.iter().any(|column| !column[row].is_finite());
        let sanitized = repair::sanitize_with(read.splats, options.damage, broken)
            .map_err(IoError::damaged(&ply_path))?;
        if let Some(kept) = &sanitized.kept {
            for column in &mut columns {
                *column = kept.iter().map(|&row| column[row]).collect();
            }
        }
        let mut notes = read.notes;
        notes.extend(iteration.notes);
        let cfg = read_cfg(&iteration.model)?;
        let mut files = vec![ply_path, network.clone()];
        files.extend(cfg.as_ref().map(|(_, path)| path.clone()));
        let facts = vec![
            ("iteration", iteration.number.to_string()),
            ("deformation", format!("iteration {number}")),
        ];
        Ok(Self {
            splats: sanitized.splats,
            repair: sanitized.report,
            columns,
            network,
            cfg: cfg.map(|(cfg, _)| cfg).unwrap_or_default(),
            facts,
            notes,
            files,
        })
    }

    /// A flag of `cfg_args`.
    pub(crate) fn flag(&self, name: &str) -> Option<bool> {
        self.cfg.get(name).and_then(Value::as_bool)
    }

    /// Background of the training images.
    pub(crate) fn background(&self) -> Option<[f32; 3]> {
        self.flag("white_background").map(|white| if white { [1.0; 3] } else { [0.0; 3] })
    }
}
