//! Reading model folders.

use super::network;
use crate::deform_folder::DeformFolder;
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::pth::{self, Layers};
use crate::scene_kind::SceneKind;
use gs_deform::MlpScene;
use std::path::Path;

/// World's upward direction of D-NeRF scenes.
pub(crate) const UP_SYNTHETIC: [f64; 3] = [0.0, 0.0, 1.0];

/// Opens a model folder, or one of the iterations of its point cloud.
///
/// # Errors
/// If files are missing or malformed, or the network is of a different kind. Every error names the
/// file.
pub fn open(dir: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let mut folder = DeformFolder::read(dir, options, |_| Vec::new())?;
    let path = folder.network.clone();
    let bytes = read_bytes(&path)?;
    let tensors =
        pth::read(&bytes).and_then(pth::Root::into_state_dict).map_err(IoError::format(&path))?;
    let layers = Layers::new(pth::siblings_of(tensors, &["linear.0.weight"]));
    let mlp = network(&layers, "").map_err(IoError::format(&path))?;
    let is_blender = layers.has("timenet.0.weight");
    let background = folder.background();
    let kind = if is_blender { "Blender" } else { "real" };
    folder.facts.push((
        "network",
        format!(
            "{} layers, the last of width {}; {kind} configuration{}",
            mlp.depth(),
            mlp.width(),
            if mlp.is_screw() { ", six degrees of freedom" } else { "" }
        ),
    ));
    let scene = MlpScene::new(folder.splats, mlp).map_err(IoError::format(&folder.files[0]))?;
    Ok(OpenedScene {
        facts: folder.facts,
        notes: folder.notes,
        repair: folder.repair,
        background,
        up: is_blender.then_some(UP_SYNTHETIC),
        ..OpenedScene::new(SceneKind::Deformable3dgs, scene, folder.files)
    })
}
