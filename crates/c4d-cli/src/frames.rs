//! Which times a command works on.

use crate::failure::{Failure, Outcome};
use gs_core::{DynamicScene, TimeRange};

/// Frames of a continuous scene when nobody says how many.
pub(crate) const DEFAULT_FRAMES: usize = 60;
/// Frames per second when nobody says how many.
const DEFAULT_FPS: f64 = 30.0;
/// More frames than this are a slip of the keyboard.
const MAX_FRAMES: usize = 100_000;

/// The times of `--times` or `--frames`, else every frame the scene was stored with, else [`DEFAULT_FRAMES`].
pub(crate) fn times(
    scene: &dyn DynamicScene,
    times: &[f32],
    frames: Option<usize>,
) -> Outcome<Vec<f32>> {
    let range = scene.time_range();
    if !times.is_empty() {
        for &t in times {
            check(range, t, "--times")?;
        }
        return Ok(times.to_vec());
    }
    let count = frames.or(scene.num_frames()).unwrap_or(DEFAULT_FRAMES);
    if count == 0 || count > MAX_FRAMES {
        return Err(Failure::usage(format!("--frames {count}: expected 1 to {MAX_FRAMES}")));
    }
    Ok(range.frames(count))
}

/// The frame rate asked for, else [`DEFAULT_FPS`]; one that no player has is refused.
pub(crate) fn fps(asked: Option<f64>) -> Outcome<f64> {
    let fps = asked.unwrap_or(DEFAULT_FPS);
    check_fps(fps)?;
    Ok(fps)
}

/// Refuses a frame rate that no player has.
pub(crate) fn check_fps(fps: f64) -> Outcome {
    if fps > 0.0 && fps <= 1000.0 {
        return Ok(());
    }
    Err(Failure::usage(format!("--fps {fps}: expected above 0, at most 1000")))
}

/// Refuses a time outside the scene.
pub(crate) fn check(range: TimeRange, t: f32, flag: &str) -> Outcome {
    if range.contains(t) {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{flag} {t} lies outside the scene's times, {} to {}",
        range.start, range.end
    ))
    .next(format!(
        "Times are normalised: {} is the first frame, {} the last, the others are evenly spaced.",
        range.start, range.end
    )))
}
