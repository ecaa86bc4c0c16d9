//! [`rigid_parts`]: the rigid parts of a scene, for selections and overlays, with progress.

use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use amg::RigidParts;
use gs_core::DynamicScene;
use std::cell::RefCell;

/// Which splats of `scene` move, and which move together, at `time`.
pub(crate) fn rigid_parts(
    scene: &dyn DynamicScene,
    time: f32,
    console: &Console,
) -> Outcome<RigidParts> {
    let progress = RefCell::new(console.percent("motion"));
    let share = |done: f32| progress.borrow_mut().set(whole_percent(done));
    let found =
        RigidParts::of(scene, time, &share).map_err(|error| Failure::bad_input(chain(&error)))?;
    let moving = found.moving.iter().filter(|&&moving| moving).count();
    console.note(format!(
        "motion: {moving} of {} splats move, in {} parts",
        found.moving.len(),
        found.num_parts
    ));
    Ok(found)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 100")]
fn whole_percent(share: f32) -> u64 {
    (100.0 * share.clamp(0.0, 1.0)) as u64
}
