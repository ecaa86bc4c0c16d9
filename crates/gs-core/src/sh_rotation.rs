//! [`ShRotation`]: spherical harmonics of a rotated or mirrored scene.

use crate::sh::{MAX_DEGREE, basis, num_coeffs};
use crate::{Real, quat};

/// Nodes and weights of Gauss-Legendre quadrature on [−1, 1], exact up to degree 7: products of two
/// harmonics have degree 6.
const HEIGHTS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_2),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_2),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];
/// Equally spaced longitudes, exact for the same products.
const LONGITUDES: u32 = 8;

/// The linear map of SH coefficients under a rotation or reflection `R` of the world: with
/// coefficients `c` and `c' = apply(c)`, the colour of `c'` in direction `R·d` is the colour of `c`
/// in direction `d`.
///
/// Degrees do not mix, so the map is one matrix per degree, `D[m][k] = ∫ Y_m(d)·Y_k(R⁻¹d) dd` over
/// the unit sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct ShRotation {
    /// `D`, zero between different degrees.
    matrix: [[f64; 16]; 16],
}

impl ShRotation {
    /// The map of the rotation by the quaternion `wxyz`, which need not have unit length; a zero
    /// quaternion gives the identity.
    pub fn new(rotation: [f64; 4]) -> Self {
        let inverse = match quat::normalize(rotation) {
            [0.0, 0.0, 0.0, 0.0] => [1.0, 0.0, 0.0, 0.0],
            unit => quat::conjugate(unit),
        };
        Self::of_inverse(|direction| quat::rotate(inverse, direction))
    }

    /// The map of the orthogonal matrix `matrix`, row-major; a determinant of −1 is a reflection.
    pub fn orthogonal(matrix: [[f64; 3]; 3]) -> Self {
        // The inverse of an orthogonal matrix is its transpose.
        Self::of_inverse(|d| [0, 1, 2].map(|i| (0..3).map(|j| matrix[j][i] * d[j]).sum()))
    }

    /// The map whose inverse on directions is `inverse`.
    fn of_inverse(inverse: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        let mut matrix = [[0.0; 16]; 16];
        for (height, height_weight) in HEIGHTS {
            let radius = (1.0 - height * height).sqrt();
            for step in 0..LONGITUDES {
                let angle = std::f64::consts::TAU * (f64::from(step) + 0.5) / f64::from(LONGITUDES);
                let direction = [radius * angle.cos(), radius * angle.sin(), height];
                let weight = height_weight * std::f64::consts::TAU / f64::from(LONGITUDES);
                let to = basis(MAX_DEGREE, direction);
                let from = basis(MAX_DEGREE, inverse(direction));
                for degree in 0..=MAX_DEGREE {
                    let band = degree * degree..num_coeffs(degree);
                    for m in band.clone() {
                        for k in band.clone() {
                            matrix[m][k] += weight * to[m] * from[k];
                        }
                    }
                }
            }
        }
        Self { matrix }
    }

    /// Rotates the coefficients `[K,3]` of one splat in place. `K`
    /// is `(degree + 1)²` for a degree up to 3.
    pub fn apply<F: Real>(&self, coeffs: &mut [[F; 3]]) {
        let mut rotated = [[0.0; 3]; 16];
        for (m, out) in rotated.iter_mut().enumerate().take(coeffs.len()) {
            for (k, rgb) in coeffs.iter().enumerate().take(16) {
                for channel in 0..3 {
                    out[channel] += self.matrix[m][k] * rgb[channel].as_f64();
                }
            }
        }
        // Degree 0 does not depend on the direction; it stays bit-identical.
        for (rgb, out) in coeffs.iter_mut().zip(rotated).skip(1) {
            *rgb = out.map(F::from_double);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_rotate_with_the_scene() {
        let rotation = quat::normalize([0.3, -0.8, 0.4, 0.2]);
        let map = ShRotation::new(rotation.map(|value| 3.0 * value));
        let before: Vec<[f64; 3]> =
            (0..16).map(|k| [f64::from(k) - 7.0, 0.1 * f64::from(k), 1.0]).collect();
        let mut after = before.clone();
        map.apply(&mut after);
        assert_eq!(after[0], before[0], "degree 0");
        for direction in [[0.48, -0.6, 0.64], [0.0, 0.0, 1.0], [-0.6, 0.8, 0.0]] {
            let (here, there) = (basis(3, direction), basis(3, quat::rotate(rotation, direction)));
            for channel in 0..3 {
                let color = |sh: &[[f64; 3]], y: &[f64; 16]| -> f64 {
                    (0..16).map(|k| sh[k][channel] * y[k]).sum()
                };
                let (expected, found) = (color(&before, &here), color(&after, &there));
                assert!((expected - found).abs() < 1e-6, "{direction:?}: {expected} {found}");
            }
        }
        let mut still = before.clone();
        ShRotation::new([0.0; 4]).apply(&mut still);
        assert!(
            still.iter().flatten().zip(before.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-6),
            "a zero quaternion gives the identity"
        );
    }

    #[test]
    fn orthogonal_matrices_may_mirror() {
        let coefficients: Vec<[f32; 3]> =
            (0..16_u8).map(|k| [0.3 - 0.05 * f32::from(k * 7 % 11), 0.0, 0.0]).collect();
        let colour = |sh: &[[f32; 3]], d: [f64; 3]| -> f64 {
            sh.iter().zip(basis(3, d)).map(|(rgb, y)| f64::from(rgb[0]) * y).sum()
        };
        let rotation = crate::rotation_matrix(quat::normalize([0.3, -0.5, 0.2, 0.9_f64]));
        let mirror = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
        for q in [rotation, mirror] {
            let image = |d: [f64; 3]| q.map(|row| row[0] * d[0] + row[1] * d[1] + row[2] * d[2]);
            let mut rotated = coefficients.clone();
            ShRotation::orthogonal(q).apply(&mut rotated);
            for d in [[0.6, 0.0, 0.8], [0.0, -1.0, 0.0], [0.48, 0.6, 0.64]] {
                let (before, after) = (colour(&coefficients, d), colour(&rotated, image(d)));
                assert!((before - after).abs() < 1e-5, "{d:?}: {before} became {after}");
            }
            // Negative control: coefficients that are not rotated give different colours.
            let d = [0.48, 0.6, 0.64];
            let change = colour(&coefficients, image(d)) - colour(&coefficients, d);
            assert!(change.abs() > 1e-2, "the test can fail: {change}");
        }
    }
}
