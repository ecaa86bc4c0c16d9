//! [`displacement`]: largest displacement of splats over the clip.

use crate::failure::{Failure, Outcome, chain};
use gs_core::{DynamicScene, Splats};

/// Number of times at which positions are compared, evenly spaced over the clip.
const TIMES: usize = 16;

/// Largest distance of each splat over the clip from its position at `time`, world units, `[N]`; 0
/// for non-finite positions.
pub(crate) fn displacement(scene: &dyn DynamicScene, time: f32) -> Outcome<Vec<f32>> {
    let failed = |error| Failure::bad_input(chain(&error));
    let mut now = Splats::default();
    scene.geometry_into(time, &mut now).map_err(failed)?;
    let then = now.means.clone();
    let mut farthest = vec![0.0_f32; then.len()];
    for t in scene.time_range().frames(TIMES) {
        scene.geometry_into(t, &mut now).map_err(failed)?;
        for (far, (a, b)) in farthest.iter_mut().zip(then.iter().zip(&now.means)) {
            let distance = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt();
            if distance.is_finite() {
                *far = far.max(distance);
            }
        }
    }
    Ok(farthest)
}
