//! Ellipsoids that a node scales along axes other than their own.

use glam::{DMat3, DQuat, DVec3};

/// Largest number of Jacobi sweeps; convergence is quadratic, so a few suffice.
const SWEEPS: usize = 32;

/// Axes and standard deviations of the Gaussian with covariance `map · mapᵀ`:
/// one-sided Jacobi rotations make the columns of `map` orthogonal; they are
/// then the axes, with the deviations as lengths.
pub(super) fn axes_of(map: DMat3) -> (DQuat, DVec3) {
    let mut columns = [map.x_axis, map.y_axis, map.z_axis];
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (a, b) = (columns[p], columns[q]);
            let product = a.dot(b);
            if product.abs() <= 1e-15 * a.length() * b.length() || product.is_nan() {
                continue;
            }
            let zeta = (b.length_squared() - a.length_squared()) / (2.0 * product);
            let tangent = 1.0_f64.copysign(zeta) / (zeta.abs() + 1.0_f64.hypot(zeta));
            let cosine = 1.0 / 1.0_f64.hypot(tangent);
            let sine = cosine * tangent;
            (columns[p], columns[q]) = (cosine * a - sine * b, sine * a + cosine * b);
            rotated = true;
        }
        if !rotated {
            break;
        }
    }
    let deviations = DVec3::from_array(columns.map(DVec3::length));
    let [x, y, z] = [0, 1, 2].map(|k| columns[k] / deviations[k]);
    // The sign of an axis is free; the result must be a rotation.
    let z = if x.cross(y).dot(z) < 0.0 { -z } else { z };
    (DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize(), deviations)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariance_is_kept() {
        let q = DQuat::from_xyzw(0.3, -0.5, 0.1, 0.8).normalize();
        let stretched = DMat3::from_diagonal(DVec3::new(3.0, 0.2, 1.0))
            * DMat3::from_quat(q)
            * DMat3::from_diagonal(DVec3::new(1.0, 1e-6, 0.4));
        let (axes, deviations) = axes_of(stretched);
        let map = DMat3::from_quat(axes) * DMat3::from_diagonal(deviations);
        let (a, b) = (stretched * stretched.transpose(), map * map.transpose());
        assert!(a.abs_diff_eq(b, 1e-12), "{a} {b}");
        assert!((deviations.min_element() / 1e-6 - 1.0).abs() < 3.0, "thin stays thin");
        let (axes, deviations) = axes_of(DMat3::IDENTITY);
        assert!(axes.w.abs() > 0.999 && deviations == DVec3::ONE, "already orthogonal");
    }
}
