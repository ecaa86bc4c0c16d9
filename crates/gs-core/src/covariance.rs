//! World-space covariance of a Gaussian.

#![expect(clippy::inline_always, reason = "inlined into vectorised loops of the rasterisers")]

use crate::{Real, Ring};

/// Rotation matrix, row-major, of quaternion `wxyz` **as given**: as in the reference kernels, the
/// quaternion is not normalised. A zero quaternion gives the identity.
#[inline(always)]
pub fn rotation_matrix<V: Ring>([w, x, y, z]: [V; 4]) -> [[V; 3]; 3] {
    let (one, two) = (w.like(1.0), w.like(2.0));
    [
        [one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)],
        [two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y)],
    ]
}

/// `Σ = R diag(s²) Rᵀ`, world units², upper triangle `[xx, xy, xz, yy, yz, zz]`, from a unit
/// quaternion `wxyz` and activated scales.
pub fn covariance<F: Real>(rotation: [F; 4], scale: [F; 3]) -> [F; 6] {
    let r = rotation_matrix(rotation);
    let m = r.map(|row| [row[0] * scale[0], row[1] * scale[1], row[2] * scale[2]]);
    let entry = |i: usize, j: usize| m[i][0] * m[j][0] + m[i][1] * m[j][1] + m[i][2] * m[j][2];
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quat;

    #[test]
    fn covariance_follows_the_rotation() {
        let half = std::f64::consts::FRAC_PI_4;
        let quarter_turn_about_z = [half.cos(), 0.0, 0.0, half.sin()];
        let sigma = covariance(quarter_turn_about_z, [3.0, 2.0, 1.0]);
        let expected = [4.0, 0.0, 0.0, 9.0, 0.0, 1.0];
        for (ours, theirs) in sigma.iter().zip(expected) {
            assert!((ours - theirs).abs() < 1e-12, "{sigma:?}");
        }
    }

    #[test]
    fn matrix_and_quaternion_rotate_alike() {
        let q = quat::normalize([0.3_f64, -0.5, 0.2, 0.9]);
        let v = [0.1, 0.7, -1.3];
        let rows = rotation_matrix(q);
        let rotated = quat::rotate(q, v);
        for axis in 0..3 {
            let by_matrix: f64 = rows[axis].iter().zip(v).map(|(a, b)| a * b).sum();
            assert!((by_matrix - rotated[axis]).abs() < 1e-12, "axis {axis}");
        }
    }
}
