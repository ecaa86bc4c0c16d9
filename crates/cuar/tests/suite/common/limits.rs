//! Limits on the quality of a repair of hidden splats.

use super::delivered::{Delivered, Judge};
use super::flicker;
use gs_core::DynamicScene;

/// Largest loss of PSNR in any part, dB.
const LOSS: f64 = 0.02;
/// Required PSNR in other pixels after a repair, unless it was lower before, dB.
const ELSEWHERE: f64 = 50.0;
/// Largest change of PSNR of a perfect edit, dB.
const PERFECT: f64 = 0.05;
/// Smallest gain in revealed pixels, mean over cases, dB.
pub const MEAN_GAIN: f64 = 6.0;
/// Largest flicker, relative to the ground truth's.
const FLICKER: f64 = 1.1;

/// Violated limits, given the PSNR of a delivered edit `before` and `after` its repair: in pixels
/// that motion reveals, elsewhere, inside the paper's mask, outside it, dB.
pub fn broken(before: [f64; 4], after: [f64; 4]) -> Vec<String> {
    let mut broken = Vec::new();
    let parts = ["revealed", "elsewhere", "in the paper's mask", "outside it"];
    for ((part, then), now) in parts.into_iter().zip(before).zip(after) {
        if now < then - LOSS {
            broken.push(format!("{part}: {then:.2} → {now:.2} dB"));
        }
    }
    if after[1] < before[1].min(ELSEWHERE) {
        broken.push(format!("elsewhere below {ELSEWHERE} dB: {:.2} → {:.2}", before[1], after[1]));
    }
    broken
}

/// Parts of the image in which a perfect edit (`before`) is changed.
pub fn broken_perfect(before: [f64; 4], after: [f64; 4]) -> Vec<String> {
    let mut parts = before.into_iter().zip(after);
    let is_same = parts.all(|(then, now)| (then - now).abs() <= PERFECT);
    if is_same { Vec::new() } else { vec![format!("perfect: {before:.2?} → {after:.2?} dB")] }
}

/// Flicker of `scene` inside the paper's mask, if it is above the ground truth's.
pub fn broken_flicker(case: &Delivered, scene: &dyn DynamicScene) -> Vec<String> {
    let shown = case.as_case();
    let clip = [0.3, 0.4, 0.5, 0.6];
    let ends = [0, shown.held_out.len() - 1];
    let [now, ideal] = [scene, &shown.truth as &dyn DynamicScene]
        .map(|scene| flicker(scene, &shown, &ends, &clip));
    let is_calm = now <= FLICKER * ideal;
    if is_calm { Vec::new() } else { vec![format!("flicker {now:.2} levels, truth {ideal:.2}")] }
}

/// Scores of `case` as delivered and as repaired, and the violated limits.
pub fn judged(
    case: &Delivered,
    repaired: &dyn DynamicScene,
    times: &[f32],
) -> ([f64; 4], [f64; 4], Vec<String>) {
    let judge = Judge::of(case, case.scene(), times);
    let [before, after] = [case.scene(), repaired].map(|scene| judge.score(scene).db());
    (before, after, broken(before, after))
}
