//! A model folder of 4DGaussians or Swift4D as an [`OpenedScene`].

use super::{Model, ModelReport, ModelScene};
use crate::deformed_model::DeformedModel;
use crate::opened_scene::OpenedScene;
use crate::scene_kind::SceneKind;
use gs_core::DynamicScene;
use std::path::Path;
use std::sync::Arc;

/// D-NeRF scenes: z points up.
const UP_SYNTHETIC: [f64; 3] = [0.0, 0.0, 1.0];
/// Channels of the planes of the published D-NeRF configurations, and of no other.
const DNERF_CHANNELS: usize = 32;

/// The model of the folder `path`, of kind [`SceneKind::Model4dgs`] or [`SceneKind::Swift4d`].
pub(crate) fn opened(path: &Path, kind: SceneKind, model: Model) -> OpenedScene {
    let Model { scene, report } = model;
    let is_swift4d = kind == SceneKind::Swift4d;
    let is_synthetic = !is_swift4d && report.channels == DNERF_CHANNELS;
    let background = match report.white_background {
        Some(white) => Some(if white { [1.0; 3] } else { [0.0; 3] }),
        // Every published Swift4D model was trained on white.
        None => is_swift4d.then_some([1.0; 3]),
    };
    let folder = report.ply.parent().unwrap_or(path);
    let network = folder.join(if is_swift4d { "FDHash.pth" } else { "deformation.pth" });
    let files = [report.ply.clone(), network, path.join("cfg_args")]
        .into_iter()
        .filter(|file| file.is_file())
        .collect();
    let (scene, deformed): (Arc<dyn DynamicScene>, _) = match scene {
        ModelScene::Deformed(scene) => {
            let scene = Arc::<gs_deform::HexPlaneScene>::from(scene);
            (Arc::clone(&scene) as _, Some(DeformedModel::HexPlane(scene)))
        }
        ModelScene::HashGrid(scene) => {
            let scene = Arc::<gs_deform::HashGridScene>::from(scene);
            (Arc::clone(&scene) as _, Some(DeformedModel::HashGrid(scene)))
        }
        ModelScene::Static(scene) => (Arc::new(scene), None),
    };
    OpenedScene {
        deformed,
        facts: facts(&report),
        warnings: report.warnings.clone(),
        notes: report.notes.clone(),
        details: report.untrained_heads.iter().map(untrained).collect(),
        repair: report.repair,
        background,
        up: is_synthetic.then_some(UP_SYNTHETIC),
        report: Some(report),
        ..OpenedScene::shared(kind, scene, files)
    }
}

fn facts(report: &ModelReport) -> Vec<(&'static str, String)> {
    // A save without a number, such as `iteration_best`, is shown by its name.
    let folder = report.ply.parent().and_then(Path::file_name);
    let iteration = match folder.filter(|_| report.iteration == 0) {
        Some(name) => name.to_string_lossy().into_owned(),
        None => report.iteration.to_string(),
    };
    let mut facts = vec![
        ("iteration", iteration),
        ("stage", format!("{:?}", report.stage).to_lowercase()),
        ("heads", report.heads.join(", ")),
    ];
    if report.width > 0 {
        facts.push((
            "network",
            format!(
                "width {}, {} levels × {} channels",
                report.width, report.levels, report.channels
            ),
        ));
    }
    if let Some(split) = report.split {
        facts.push((
            "dynamic",
            format!(
                "{} of {} splats, {} of them in the field's box; the others never move",
                split.num_dynamic, report.num_splats, split.num_moving
            ),
        ));
    }
    for flag in &report.flags {
        facts.push(("flag", format!("{} = {} ({:?})", flag.name, flag.value, flag.origin)));
    }
    facts
}

fn untrained(head: &&'static str) -> String {
    format!("head `{head}` still has its initial weights: it was probably not trained")
}
