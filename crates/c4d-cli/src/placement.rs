//! Where a scene lies, and whether single precision can hold it there.

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::scene::Opened;
use gs_core::Extent;

/// Steps of positions larger than these shares of a splat's size and of the scene's radius are
/// seen: rounding moves splats by half a step, and pictures have some thousand pixels.
const SPLAT_SHARE: f64 = 0.25;
const SCENE_SHARE: f64 = 1e-3;

/// Extent of a scene's first frame; of a run, that of its source.
pub(crate) fn of_scene(opened: &Opened) -> Outcome<Extent> {
    let scene = opened.original.as_ref().unwrap_or(&opened.scene);
    let first = scene.at(scene.time_range().start).map_err(Failure::input)?;
    Ok(Extent::of(&first))
}

/// Warns of a scene so far from its origin that single-precision positions are coarser than its
/// splats.
pub(crate) fn warn_if_coarse(extent: &Extent, console: &Console) {
    let step = extent.position_step();
    if step > (SPLAT_SHARE * extent.splat_size).min(SCENE_SHARE * extent.radius) {
        let distance = extent.centre.iter().map(|x| x * x).sum::<f64>().sqrt();
        console.warn(format!(
            "the scene lies {distance:.1e} units from its origin, where single-precision positions are {step:.1e} units apart; its splats are about {:.1e} units large, so they are misplaced visibly. Move the scene to the origin in the tool that made it",
            extent.splat_size
        ));
    }
}
