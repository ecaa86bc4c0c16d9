//! Small mathematics shared by the generators: seeded draws, ramps, low-discrepancy points.

use glam::{DQuat, DVec3, Mat3, Quat, Vec3};
use gs_core::SplitMix64;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A generator for one purpose: equal seeds with different `stream`s are independent, so that
/// adding draws of one kind does not change others.
pub(crate) fn rng(seed: u64, stream: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed ^ stream.wrapping_mul(SplitMix64::GOLDEN))
}

/// Uniform in `[low, high)`.
pub(crate) fn uniform(rng: &mut Pcg64, low: f32, high: f32) -> f32 {
    low + (high - low) * rng.random::<f32>()
}

/// Standard normal.
pub(crate) fn normal(rng: &mut Pcg64) -> f32 {
    let (u, v) = (rng.random(), rng.random());
    gs_core::standard_normal(u, v)
}

/// Three standard normals.
pub(crate) fn normal3(rng: &mut Pcg64) -> Vec3 {
    Vec3::new(normal(rng), normal(rng), normal(rng))
}

/// 0 below `low`, 1 above `high`, smooth between.
pub(crate) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let x = ((x - low) / (high - low)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Point `k` of the two-dimensional golden-ratio sequence, shifted.
pub(crate) fn r2(k: usize, shift: [f32; 2]) -> [f32; 2] {
    const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    [0, 1].map(|axis| narrow((f64::from(shift[axis]) + STEP[axis] * k as f64).fract()))
}

/// Rounds to single precision.
#[expect(clippy::cast_possible_truncation, reason = "splats are stored in single precision")]
pub(crate) fn narrow(x: f64) -> f32 {
    x as f32
}

/// Rounds down to an index; negative and NaN give 0.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "callers pass small non-negative values; the cast saturates otherwise"
)]
pub(crate) fn floor_index(x: f32) -> usize {
    x as usize
}

/// Nearest whole count; negative and NaN give 0.
pub(crate) fn round_count(x: f32) -> usize {
    floor_index(x.round())
}

/// A row number of a scene.
pub(crate) fn row_id(row: usize) -> u32 {
    u32::try_from(row).expect("scenes are limited to fewer than 2^32 splats")
}

pub(crate) fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from(v).as_dvec3()
}

/// `wxyz`, single precision.
pub(crate) fn wxyz(q: DQuat) -> [f32; 4] {
    [narrow(q.w), narrow(q.x), narrow(q.y), narrow(q.z)]
}

/// Rotation whose columns are `x`, `y`, `z` (orthonormal, right-handed).
pub(crate) fn quat_from_axes(x: Vec3, y: Vec3, z: Vec3) -> Quat {
    Quat::from_mat3(&Mat3::from_cols(x, y, z))
}

/// `total` items shared in proportion to `weights`, by largest remainder; ties by index.
pub(crate) fn apportion(total: usize, weights: &[f64]) -> Vec<usize> {
    let sum: f64 = weights.iter().sum();
    if weights.is_empty() || sum <= 0.0 {
        return vec![0; weights.len()];
    }
    let exact: Vec<f64> = weights.iter().map(|w| total as f64 * w / sum).collect();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "shares are between 0 and total"
    )]
    let mut counts: Vec<usize> = exact.iter().map(|share| *share as usize).collect();
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|&a, &b| exact[b].fract().total_cmp(&exact[a].fract()).then(a.cmp(&b)));
    let missing = total.saturating_sub(counts.iter().sum());
    for &id in order.iter().cycle().take(missing) {
        counts[id] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn apportion_gives_exactly_the_total() {
        assert_eq!(apportion(10, &[1.0, 1.0, 1.0]).iter().sum::<usize>(), 10, "sum");
        assert_eq!(apportion(7, &[0.0, 3.0]), [0, 7], "no share without weight");
    }
}
