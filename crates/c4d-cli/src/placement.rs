//! Position of a scene, and whether single precision suffices for it.

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::scene::LoadedScene;
use gs_core::Extent;

/// Position steps above these shares of a splat's size and of the scene's radius are visible:
/// rounding moves splats by up to half a step, and images have about a thousand pixels.
const SPLAT_SHARE: f64 = 0.25;
const SCENE_SHARE: f64 = 1e-3;

/// Extent of a scene's first frame; for a run, of its source.
pub(crate) fn of_scene(opened: &LoadedScene) -> Outcome<Extent> {
    let scene = opened.original.as_ref().unwrap_or(&opened.scene);
    let first = scene.at(scene.time_range().start).map_err(Failure::input)?;
    Ok(Extent::of(&first))
}

/// Warns about a scene so far from its origin that
/// single-precision positions are coarser than its splats.
pub(crate) fn warn_if_coarse(extent: &Extent, console: &Console) {
    let step = extent.position_step();
    if step > (SPLAT_SHARE * extent.splat_size).min(SCENE_SHARE * extent.radius) {
        let distance = extent.centre.iter().map(|x| x * x).sum::<f64>().sqrt();
        console.warn(format!(
            "the scene is {distance:.1e} units from its origin, where single-precision positions \
            are {step:.1e} units apart; its splats have a size of about {:.1e} units, so rounding \
            is visible. Move the scene to the origin in the tool that made it",
            extent.splat_size
        ));
    }
}
