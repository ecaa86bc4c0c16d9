//! Reading model folders.

use super::options::TrainingOptions;
use super::stage;
use crate::cfg_args;
use crate::error::IoError;
use crate::fs::text;
use crate::fs::{list_names, read_bytes};
use crate::model_folder;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::ply;
use crate::pth::{self, Layers};
use crate::repair::{self, Sanitized};
use crate::scene_kind::SceneKind;
use gs_deform::EmbeddingScene;
use std::path::Path;

/// First column of the embeddings.
const FIRST: &str = "embedding_0";
/// File of the network.
const NETWORK: &str = "deformation.pth";

/// Whether a folder is such a model: its PLY has embeddings.
pub(crate) fn looks_like_model(dir: &Path) -> bool {
    let has_embeddings = || -> Option<bool> {
        let iteration = model_folder::find(dir, None).ok()?;
        let header = ply::read_header_file(&iteration.dir.join("point_cloud.ply")).ok()?;
        let layout = header.gaussians().ok()?;
        Some(layout.extra_columns.iter().any(|column| column == FIRST))
    };
    // An empty or unreadable folder is not one.
    list_names(dir).is_ok_and(|names| !names.is_empty()) && has_embeddings().unwrap_or(false)
}

/// Opens a model folder, or one of the iterations of its point cloud.
///
/// # Errors
/// If files are missing or malformed. Every error names the file.
pub fn open(dir: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let iteration = model_folder::find(dir, options.iteration)?;
    let ply_path = iteration.dir.join("point_cloud.ply");
    let bytes = read_bytes(&ply_path)?;
    let read = ply::read(&bytes).map_err(IoError::format(&ply_path))?;
    let name = |index: usize| format!("embedding_{index}");
    let names: Vec<String> = (0..read.extra_columns.len())
        .map(name)
        .take_while(|name| read.extra_columns.contains(name))
        .collect();
    let columns = ply::read_columns(&bytes, &names).map_err(IoError::format(&ply_path))?;
    let broken = |row: usize| columns.iter().any(|column| !column[row].is_finite());
    let Sanitized { splats, kept, report } =
        repair::sanitize_with(read.splats, options.damage, broken)
            .map_err(IoError::damaged(&ply_path))?;
    let rows = kept.unwrap_or_else(|| (0..splats.len()).collect());
    let embeddings: Vec<f32> =
        rows.iter().flat_map(|&row| columns.iter().map(move |column| column[row])).collect();

    let path = iteration.dir.join(NETWORK);
    if !path.is_file() {
        return Err(IoError::content(
            &path,
            "is missing, without which the model cannot move; copy it from the machine that \
            trained the model (training writes it next to point_cloud.ply)",
        ));
    }
    let cfg_path = iteration.model.join("cfg_args");
    let mut notes = read.notes;
    notes.extend(iteration.notes);
    let mut warnings = Vec::new();
    let cfg = if cfg_path.is_file() {
        let text = read_bytes(&cfg_path)?;
        cfg_args::parse(&text::decode(&text)).map_err(IoError::format(&cfg_path))?
    } else {
        warnings.push(format!(
            "{} is missing: the defaults of E-D3DGS are used; if the motion looks wrong, copy it \
            from the machine that trained the model",
            cfg_path.display()
        ));
        cfg_args::CfgArgs::default()
    };
    let bytes = read_bytes(&path)?;
    let tensors =
        pth::read(&bytes).and_then(pth::Root::into_state_dict).map_err(IoError::format(&path))?;
    let layers = Layers::new(pth::siblings_of(tensors, &["feature_out_f.0.weight"]));
    let chosen = TrainingOptions::read(&cfg, iteration.number);
    let stages = stage::stages(&layers, &chosen).map_err(IoError::format(&path))?;
    let offset = stage::mean_offset(&layers);
    let facts = vec![
        ("iteration", iteration.number.to_string()),
        ("stages", chosen.stages()),
        ("deformed", chosen.deformed()),
    ];
    let scene =
        EmbeddingScene::new(splats, embeddings, stages, offset).map_err(IoError::format(&path))?;
    let mut files = vec![ply_path, path];
    files.extend(Some(cfg_path).filter(|path| path.is_file()));
    Ok(OpenedScene {
        facts,
        notes,
        warnings,
        repair: report,
        background: Some(if chosen.white_background { [1.0; 3] } else { [0.0; 3] }),
        ..OpenedScene::new(SceneKind::Ed3dgs, scene, files)
    })
}
