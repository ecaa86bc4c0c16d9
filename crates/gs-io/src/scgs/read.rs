//! Reading model folders.

use super::ScgsError;
use crate::cfg_args::Value;
use crate::deform_folder::DeformFolder;
use crate::deformable3dgs;
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::pth::{self, Layers};
use crate::scene_kind::SceneKind;
use gs_core::activation;
use gs_deform::{NodeGraph, NodeGraphScene};
use std::path::Path;

/// Number of nodes per splat, if `cfg_args` does not state it.
const NEIGHBORS: usize = 3;
/// Largest accepted number of nodes per splat.
const MAX_NEIGHBORS: u64 = 64;
/// Options that change the evaluation and are not supported.
const UNSUPPORTED: [&str; 5] =
    ["use_hash", "hash_time", "progressive_brand_time", "skinning", "d_rot_as_rotmat"];

/// Opens a model folder, or one of the iterations of its point cloud.
///
/// # Errors
/// If files are missing or malformed, or the model was trained with an option that is not
/// supported. Every error names the file.
pub fn open(dir: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let features = |extra: &[String]| -> Vec<String> {
        let name = |index: usize| format!("fea_{index}");
        (0..extra.len()).map(name).take_while(|name| extra.contains(name)).collect()
    };
    let mut folder = DeformFolder::read(dir, options, features)?;
    if let Some(option) = UNSUPPORTED.iter().find(|name| folder.flag(name) == Some(true)) {
        let path = folder.files.last().unwrap_or(&folder.network);
        return Err(IoError::format(path)(ScgsError::Unsupported { option }));
    }
    let path = folder.network.clone();
    let bytes = read_bytes(&path)?;
    let tensors =
        pth::read(&bytes).and_then(pth::Root::into_state_dict).map_err(IoError::format(&path))?;
    let layers = Layers::new(pth::siblings_of(tensors, &["_node_radius"]));
    let mlp = deformable3dgs::network(&layers, "network.").map_err(IoError::format(&path))?;
    let graph = graph(&layers, &folder).map_err(IoError::format(&path))?;
    let is_blender = layers.has("network.timenet.0.weight");
    let background = folder.background();
    folder
        .facts
        .push(("network", format!("{} layers, the last of width {}", mlp.depth(), mlp.width())));
    folder.facts.push((
        "nodes",
        format!(
            "{}, {} per splat{}{}",
            graph.log_radii.len(),
            graph.neighbors,
            if layers.has("network.local_rotation.weight") { ", local frames" } else { "" },
            if graph.masks.is_empty() { "" } else { ", motion mask" }
        ),
    ));
    let scene = NodeGraphScene::new(folder.splats, graph, mlp).map_err(IoError::format(&path))?;
    Ok(OpenedScene {
        facts: folder.facts,
        notes: folder.notes,
        repair: folder.repair,
        background,
        up: is_blender.then_some(deformable3dgs::UP_SYNTHETIC),
        ..OpenedScene::new(SceneKind::Scgs, scene, folder.files)
    })
}

/// The nodes, and the hyper coordinates of the splats.
fn graph(layers: &Layers<'_>, folder: &DeformFolder) -> Result<NodeGraph, ScgsError> {
    let nodes = layers.need("nodes")?;
    let &[count, dims] = nodes.shape() else {
        return Err(ScgsError::Nodes { shape: nodes.shape().to_vec() });
    };
    let hyper =
        dims.checked_sub(3).ok_or_else(|| ScgsError::Nodes { shape: nodes.shape().to_vec() })?;
    let columns = &folder.columns;
    let masked = match columns.len().checked_sub(hyper) {
        Some(0) => false,
        Some(1) => true,
        _ => {
            return Err(ScgsError::HyperCoordinates { hyper, columns: columns.len() });
        }
    };
    let n = folder.splats.len();
    let mut coordinates = Vec::with_capacity(n * hyper);
    for row in 0..n {
        coordinates.extend(columns[..hyper].iter().map(|column| column[row]));
    }
    let masks = columns[hyper..].iter().flatten().map(|&logit| activation::sigmoid(logit));
    let neighbors = match folder.cfg.get("K").map(Value::as_u64) {
        None => NEIGHBORS,
        Some(Some(k @ 1..=MAX_NEIGHBORS)) => usize::try_from(k).unwrap_or(NEIGHBORS),
        Some(_) => {
            return Err(ScgsError::Neighbors { largest: MAX_NEIGHBORS });
        }
    };
    #[expect(clippy::cast_possible_truncation, reason = "an option")]
    let max_scale = folder.cfg.get("max_d_scale").and_then(Value::as_f64).map(|bound| bound as f32);
    Ok(NodeGraph {
        nodes: nodes.to_f32s(),
        dims,
        log_radii: layers.values("_node_radius", &[count])?,
        weight_logits: layers.values("_node_weight", &[count, 1])?,
        hyper: coordinates,
        masks: if masked { masks.collect() } else { Vec::new() },
        neighbors,
        max_scale: max_scale.filter(|bound| *bound > 0.0),
    })
}
