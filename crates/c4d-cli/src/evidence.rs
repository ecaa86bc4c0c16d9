//! [`evidence`]: colour uncertainty of splats that the edited frame does not show.

use crate::camera_rig::CameraRig;
use crate::commands::refine::RIG_SIZE;
use crate::device::Device;
use crate::failure::{Failure, Outcome};
use crate::passes;
use crate::scene::LoadedScene;
use cuar::BeforeEdit;

/// ξ′ of a run's splats in the edited frame, from the views of a
/// refinement without cameras; empty for other scenes.
pub(crate) fn evidence(opened: &LoadedScene, device: &Device) -> Outcome<Vec<f32>> {
    let (Some(original), Some(source_rows), Some(params)) =
        (&opened.original, &opened.source_rows, &opened.mask.evidence)
    else {
        return Ok(Vec::new());
    };
    let rig = CameraRig::of_scene(original.as_ref(), opened.up).map_err(Failure::bad_input)?;
    let (cameras, _) = rig.refining(RIG_SIZE);
    let before = BeforeEdit { scene: original.as_ref(), source_rows };
    let scene = opened.scene.as_ref();
    passes::evidence(device, scene, &before, opened.edit_time, &cameras, params)
}
