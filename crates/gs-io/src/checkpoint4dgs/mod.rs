//! Model folders of 4DGaussians: canonical PLY, deformation network, flags of the training run.
//!
//! Flags that the tensors do not reveal are trusted in this order: override, `cfg_args`, guess from the published
//! configurations, defaults; [`ModelReport`] says where each came from.

mod flags;
mod folder;
mod network;
mod report;
mod write;

pub use flags::{FlagReport, Origin, Overrides};
pub use report::{ModelReport, Split, Stage};
pub use write::write;

pub(crate) use folder::{Iteration, find, has_in_iterations, looks_like_model, still_model};

use crate::cfg_args::{self, CfgArgs};
use crate::error::{IoError, read_bytes};
use crate::repair::{self, Sanitized};
use crate::{ply, pth, text};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use gs_deform::{HashGridScene, HexPlaneField, HexPlaneScene, StaticScene};
use std::path::Path;

/// The scene of a model folder.
#[derive(Debug)]
pub enum ModelScene {
    /// With its deformation network.
    Deformed(Box<HexPlaneScene>),
    /// With its hash grid, which moves a part of the splats: a Swift4D model.
    HashGrid(Box<HashGridScene>),
    /// Saved in the coarse stage, before any deformation.
    Static(StaticScene),
}

impl ModelScene {
    /// The scene as its trait.
    pub fn as_dyn(&self) -> &dyn DynamicScene {
        match self {
            Self::Deformed(scene) => &**scene,
            Self::HashGrid(scene) => &**scene,
            Self::Static(scene) => scene,
        }
    }

    /// The splats as stored, before any deformation.
    pub fn canonical(&self) -> &Splats {
        match self {
            Self::Deformed(scene) => scene.canonical(),
            Self::HashGrid(scene) => scene.canonical(),
            Self::Static(scene) => scene.splats(),
        }
    }
}

impl DynamicScene for ModelScene {
    fn num_splats(&self) -> usize {
        self.as_dyn().num_splats()
    }

    fn sh_degree(&self) -> usize {
        self.as_dyn().sh_degree()
    }

    fn time_range(&self) -> TimeRange {
        self.as_dyn().time_range()
    }

    fn num_frames(&self) -> Option<usize> {
        self.as_dyn().num_frames()
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.as_dyn().at_into(t, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.as_dyn().geometry_into(t, out)
    }

    fn fades(&self) -> bool {
        self.as_dyn().fades()
    }

    fn dynamic_mask(&self) -> Option<&[bool]> {
        self.as_dyn().dynamic_mask()
    }
}

/// A model folder, read.
#[derive(Debug)]
pub struct Model {
    /// The scene, at times from 0.
    pub scene: ModelScene,
    /// What was found and decided.
    pub report: ModelReport,
}

/// Opens a model folder, or one of its `iteration_<n>` folders.
///
/// # Errors
/// If files are missing or malformed, or the network is one that the reference implementation cannot evaluate either. Every
/// error names the file.
pub fn open(dir: impl AsRef<Path>, overrides: &Overrides) -> Result<Model, IoError> {
    let Begun { iteration, splats, mut report, cfg } = begin(dir.as_ref(), overrides)?;
    let scene = match iteration.stage {
        Stage::Coarse => never_moving(&iteration, splats, &mut report)?,
        Stage::Fine => {
            let (field, has_sh_head) =
                read_field(&iteration, cfg.as_ref(), overrides, &mut report)?;
            let scene = HexPlaneScene::new(splats, field).map_err(|source| {
                let advice = format!(
                    "{source}; if the model was trained without SH deformation, override no_dshs"
                );
                match source {
                    gs_deform::FieldError::Unsupported(_) => IoError::content(&report.ply, advice),
                    _ => IoError::Field { path: report.ply.clone(), source },
                }
            })?;
            let table = if has_sh_head { None } else { read_table(&iteration, &mut report)? };
            let scene = match table {
                None => scene,
                Some(moving) => scene
                    .with_moving(&moving)
                    .map_err(|source| IoError::Field { path: report.ply.clone(), source })?,
            };
            ModelScene::Deformed(Box::new(scene))
        }
    };
    Ok(Model { scene, report })
}

/// What every kind of model folder begins with.
#[derive(Debug)]
pub(crate) struct Begun {
    pub(crate) iteration: Iteration,
    /// Undamaged splats of the PLY.
    pub(crate) splats: Splats,
    pub(crate) report: ModelReport,
    pub(crate) cfg: Option<CfgArgs>,
}

/// Finds the iteration and reads its PLY and the flags of the training run.
pub(crate) fn begin(dir: &Path, overrides: &Overrides) -> Result<Begun, IoError> {
    let iteration = folder::find(dir, overrides.iteration)?;
    let ply_path = iteration.dir.join("point_cloud.ply");
    let read = ply::read_file(&ply_path)?;
    let sanitized = repair::sanitize(read.splats, overrides.damage)
        .map_err(|source| IoError::Damaged { path: ply_path.clone(), source })?;
    let mut report = ModelReport::new(&iteration, ply_path, &sanitized);
    report.notes.extend(read.notes);
    report.warnings.extend(iteration.notes.iter().cloned());
    let cfg = read_cfg(&iteration, &mut report)?;
    report.white_background =
        cfg.as_ref().and_then(|cfg| cfg.get("white_background")).and_then(cfg_args::Value::as_bool);
    let Sanitized { splats, .. } = sanitized;
    Ok(Begun { iteration, splats, report, cfg })
}

/// The scene of a save from before the deformation was trained.
pub(crate) fn never_moving(
    iteration: &Iteration,
    splats: Splats,
    report: &mut ModelReport,
) -> Result<ModelScene, IoError> {
    report.warnings.push(
        "the folder holds only saves of the coarse stage: nothing moves in this model".to_owned(),
    );
    let scene = StaticScene::new(splats)
        .map_err(|error| IoError::content(&iteration.dir, error.to_string()))?;
    Ok(ModelScene::Static(scene))
}

fn read_cfg(iteration: &Iteration, report: &mut ModelReport) -> Result<Option<CfgArgs>, IoError> {
    let path = iteration.model.join("cfg_args");
    if !path.is_file() {
        if iteration.stage == Stage::Coarse {
            return Ok(None); // There is no network to guess the flags of.
        }
        report.warnings.push(format!(
            "{} is missing: flags of the training run are guessed from the network; override them if the motion looks wrong",
            path.display()
        ));
        return Ok(None);
    }
    let cfg = match cfg_args::parse(&text::decode(&read_bytes(&path)?)) {
        Ok(cfg) => cfg,
        Err(source) => return Err(IoError::Cfg { path, source }),
    };
    let (decisive, rest): (Vec<&str>, Vec<&str>) =
        cfg.unread.iter().map(String::as_str).partition(|name| DECISIVE.contains(name));
    if !decisive.is_empty() {
        report.warnings.push(format!(
            "cfg_args: values of {} are not understood and count as missing; override them if the motion looks wrong",
            decisive.join(", ")
        ));
    }
    if !rest.is_empty() {
        report
            .notes
            .push(format!("cfg_args: fields not understood, and not needed: {}", rest.join(", ")));
    }
    Ok(Some(cfg))
}

/// Fields of `cfg_args` on which the motion or the look depends.
const DECISIVE: [&str; 20] = [
    "no_dx",
    "no_ds",
    "no_dr",
    "no_do",
    "no_dshs",
    "no_grid",
    "apply_rotation",
    "grid_pe",
    "net_width",
    "multires",
    "kplanes_config",
    "white_background",
    "activation",
    "dynamic_thro",
    "n_levels",
    "n_features_per_level",
    "hashmap_size",
    "base_resolution",
    "n_neurons",
    "source_path",
];

/// The network, and whether it is of a revision that deforms SH (and ignores the table).
fn read_field(
    iteration: &Iteration,
    cfg: Option<&CfgArgs>,
    overrides: &Overrides,
    report: &mut ModelReport,
) -> Result<(HexPlaneField, bool), IoError> {
    let path = iteration.dir.join("deformation.pth");
    if !path.is_file() {
        return Err(IoError::content(
            &path,
            "is missing, so the model cannot move; copy it from the machine that trained the model, or ask for another iteration",
        ));
    }
    let bytes = read_bytes(&path)?;
    let wrong = |source| IoError::Pth { path: path.clone(), source };
    let tensors = pth::read(&bytes).and_then(pth::Root::into_state_dict).map_err(wrong)?;
    let tensors = network::Tensors::new(tensors);
    let shape = tensors.shape().map_err(|what| IoError::content(&path, what))?;
    let flags = flags::decide(&shape, cfg, overrides, report)
        .map_err(|what| IoError::content(&path, what))?;
    report.describe(&shape, &flags, &tensors);
    let network = tensors.network(&shape, &flags).map_err(|what| IoError::content(&path, what))?;
    let field = HexPlaneField::new(network).map_err(|source| IoError::Field { path, source })?;
    Ok((field, shape.has_sh_head))
}

/// Rows of the table that early revisions did not move, `None` when all move or the (optional) table is missing.
fn read_table(
    iteration: &Iteration,
    report: &mut ModelReport,
) -> Result<Option<Vec<bool>>, IoError> {
    let path = iteration.dir.join("deformation_table.pth");
    if !path.is_file() {
        return Ok(None);
    }
    let table = pth::with_file(&path, |root| Ok(root.into_tensor()?.to_f32s()))?;
    let rows = report.repair.rows;
    if table.len() != rows {
        return Err(IoError::content(
            &path,
            format!("has {} entries, but point_cloud.ply has {rows} rows", table.len()),
        ));
    }
    let still = table.iter().filter(|&&moves| moves == 0.0).count();
    if still == 0 {
        return Ok(None);
    }
    report.warnings.push(format!(
        "{} holds {still} Gaussians still, as revisions of autumn 2023 did",
        path.display()
    ));
    let moving = |row: usize| table[row] != 0.0;
    Ok(Some(match &report.kept_rows {
        Some(kept) => kept.iter().map(|&row| moving(row)).collect(),
        None => (0..rows).map(moving).collect(),
    }))
}
