//! Shapes of Gaussians as unit rotations and log-scales, computed from other inputs of rasterisers:
//! unnormalised quaternions, scales of any sign, covariances.

use gs_core::{Splats, quat, rotation_matrix};
use rayon::prelude::*;

/// Log-scale of an axis without extent: a standard deviation of 2·10⁻⁹, whose square and its
/// inverse are normal numbers.
const FLAT_LOG_SCALE: f32 = -20.0;
/// Largest distance of a squared norm from 1 at which a quaternion counts as a unit quaternion: the
/// error of normalising in single precision.
const UNIT: f64 = 1e-6;
/// Largest number of Jacobi sweeps; 3×3 matrices need four or five.
const MAX_SWEEPS: usize = 16;

/// Splats as passed to the reference's rasteriser, which does not
/// normalise quaternions and squares every scale.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RasterizedShapes {
    /// Centres, world units, `[N,3]`.
    pub means: Vec<[f32; 3]>,
    /// Quaternions `wxyz`, of any norm, `[N,4]`.
    pub quats: Vec<[f32; 4]>,
    /// Scales along the local axes, world units, of any sign, `[N,3]`.
    pub scales: Vec<[f32; 3]>,
}

impl RasterizedShapes {
    /// Writes the geometry of the splats with the same covariances: unit quaternions, log-scales.
    pub(crate) fn into_splats(self, out: &mut Splats) {
        out.means = self.means;
        let (quats, log_scales) = self
            .quats
            .par_iter()
            .zip(&self.scales)
            .map(|(&q, &scale)| from_unnormalized(q, scale))
            .unzip();
        (out.quats, out.log_scales) = (quats, log_scales);
    }
}

/// `ln |scale|`; [`FLAT_LOG_SCALE`] for 0. NaN remains NaN.
pub(crate) fn log_scale(scale: f32) -> f32 {
    let log = scale.abs().ln();
    if log < FLAT_LOG_SCALE { FLAT_LOG_SCALE } else { log }
}

/// Unit rotation and log-scales of the covariance `M·diag(s²)·Mᵀ`, where `M` is the matrix of the
/// quaternion `wxyz` **as given**. The rasteriser of 3DGS does not normalise: a quaternion of norm
/// `n` gives `M = (1 − n²)·I + n²·R`, which is not a rotation unless `n = 1`.
pub(crate) fn from_unnormalized(q: [f32; 4], scale: [f32; 3]) -> ([f32; 4], [f32; 3]) {
    let wide = q.map(f64::from);
    let norm_squared = quat::dot(wide, wide);
    // NaN remains NaN, so that callers can detect the invalid row.
    if !norm_squared.is_finite() || (norm_squared - 1.0).abs() <= UNIT {
        return (quat::normalize(q), scale.map(log_scale));
    }
    let unit = if norm_squared > 0.0 { quat::normalize(wide) } else { [1.0, 0.0, 0.0, 0.0] };
    let m = rotation_matrix(wide);
    let squares = scale.map(|s| f64::from(s).powi(2));
    let mut covariance = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            covariance[i][j] = (0..3).map(|k| m[i][k] * squares[k] * m[j][k]).sum();
        }
    }
    principal_axes(covariance, unit)
}

/// Unit rotation and log-scales of a symmetric covariance. Among the equivalent
/// choices of axes, the one closest to the unit quaternion `near`, so that a shape
/// that changes little over time has axes that change little.
pub(crate) fn principal_axes(covariance: [[f64; 3]; 3], near: [f64; 4]) -> ([f32; 4], [f32; 3]) {
    let r = rotation_matrix(near);
    // The covariance in the axes of `near`: Rᵀ·C·R.
    let mut a = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            a[i][j] = (0..3)
                .map(|k| (0..3).map(|l| r[k][i] * covariance[k][l] * r[l][j]).sum::<f64>())
                .sum();
        }
    }
    let mut q = near;
    for _ in 0..MAX_SWEEPS {
        let off = a[0][1].abs() + a[0][2].abs() + a[1][2].abs();
        let trace = a[0][0].abs() + a[1][1].abs() + a[2][2].abs();
        if off <= f64::EPSILON * 1e-2 * trace || !off.is_finite() {
            break;
        }
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            q = rotate_pair(&mut a, q, i, j);
        }
    }
    let q = quat::normalize(q);
    #[expect(clippy::cast_possible_truncation, reason = "splats are single precision")]
    let rotation = q.map(|component| component as f32);
    #[expect(clippy::cast_possible_truncation, reason = "splats are single precision")]
    let log_scales = [0, 1, 2].map(|k| {
        let log = 0.5 * a[k][k].max(0.0).ln();
        if log < f64::from(FLAT_LOG_SCALE) { FLAT_LOG_SCALE } else { log as f32 }
    });
    (rotation, log_scales)
}

/// Zeroes entry (i, j) of `a` with the smaller of the two possible
/// rotations, and returns `q` composed with it.
fn rotate_pair(a: &mut [[f64; 3]; 3], q: [f64; 4], i: usize, j: usize) -> [f64; 4] {
    let off = a[i][j];
    if off == 0.0 {
        return q;
    }
    let theta = (a[j][j] - a[i][i]) / (2.0 * off);
    let tangent = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    let sine = tangent * cosine;
    a[i][i] -= tangent * off;
    a[j][j] += tangent * off;
    a[i][j] = 0.0;
    a[j][i] = 0.0;
    let k = 3 - i - j;
    let (at_i, at_j) = (a[i][k], a[j][k]);
    a[i][k] = cosine * at_i - sine * at_j;
    a[j][k] = sine * at_i + cosine * at_j;
    a[k][i] = a[i][k];
    a[k][j] = a[j][k];
    // Columns i and j of the basis become c·eᵢ − s·eⱼ and s·eᵢ + c·eⱼ: a rotation by −atan(t) in the
    // plane from i to j.
    let half = 0.5 * -tangent.atan();
    let mut rotation = [half.cos(), 0.0, 0.0, 0.0];
    // Rotations from x to y and from y to z are about +z and +x; from x to z about −y.
    rotation[1 + k] = if k == 1 { -half.sin() } else { half.sin() };
    quat::mul(q, rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::covariance;

    fn given(q: [f32; 4], scale: [f32; 3]) -> [f64; 6] {
        covariance(q.map(f64::from), scale.map(f64::from))
    }

    fn made(q: [f32; 4], log_scales: [f32; 3]) -> [f64; 6] {
        covariance(q.map(f64::from), log_scales.map(|log| f64::from(log).exp()))
    }

    #[test]
    fn covariance_equals_that_of_the_unnormalised_input() {
        let quats: [[f32; 4]; 5] = [
            [0.9, 0.3, -0.2, 0.4],
            [1.2, -0.5, 0.1, 0.3],
            [0.2, 0.1, -0.1, 0.05],
            [0.0; 4],
            [-0.8, 0.6, 0.0, 0.0],
        ];
        for q in quats {
            for scale in [[0.3, -0.02, 0.1], [0.2, 0.2, 0.2], [1e-3, 2.0, 0.5]] {
                let (unit, log_scales) = from_unnormalized(q, scale);
                let norm = quat::dot(unit, unit);
                assert!((norm - 1.0).abs() < 1e-6, "{unit:?}");
                let (found, expected) = (made(unit, log_scales), given(q, scale));
                let size = expected[0] + expected[3] + expected[5];
                for (found, expected) in found.iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-6 * size, "{q:?} {scale:?}: {found}");
                }
            }
        }
    }

    #[test]
    fn axes_are_close_to_the_previous_ones() {
        let scale = [0.3, 0.1, 0.2];
        let mut last = from_unnormalized([0.9, 0.3, -0.2, 0.3], scale).0;
        for step in 1_u8..50 {
            let drift = 0.01 * f32::from(step);
            let (next, _) = from_unnormalized([0.9 + drift, 0.3 - drift, -0.2, 0.3], scale);
            assert!(quat::dot(last, next) > 0.999, "step {step}: {last:?} {next:?}");
            last = next;
        }
    }

    #[test]
    fn flat_axes_are_finite_and_nan_remains_nan() {
        assert_eq!(log_scale(0.0), FLAT_LOG_SCALE, "no extent");
        assert!(log_scale(f32::NAN).is_nan(), "NaN stays");
        let (q, log_scales) = principal_axes([[0.0; 3]; 3], [1.0, 0.0, 0.0, 0.0]);
        assert_eq!((q, log_scales), ([1.0, 0.0, 0.0, 0.0], [FLAT_LOG_SCALE; 3]), "a point");
        let (q, _) = from_unnormalized([f32::NAN, 0.0, 0.0, 0.0], [1.0; 3]);
        assert!(q[0].is_nan(), "NaN remains NaN");
    }
}
