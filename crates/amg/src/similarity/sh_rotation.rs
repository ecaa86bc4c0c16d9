//! [`ShRotation`]: rotation of spherical harmonics.

use gs_core::{Real, sh};

/// Nodes and weights of Gauss–Legendre quadrature in `z`, exact up to degree 7.
const NODES: [[f64; 2]; 4] = [
    [-0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
    [-0.339_981_043_584_856_26, 0.652_145_154_862_546_2],
    [0.339_981_043_584_856_26, 0.652_145_154_862_546_2],
    [0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
];
/// Directions per node: uniform azimuths are exact up to one degree less, and products of two bases
/// have degree 6.
const AZIMUTHS: u32 = 8;

/// Rotation of SH coefficients of degree 0 to 3, one block per degree.
///
/// A splat rotated by `Q` has in direction `d` the colour that it had in `Q⁻¹ d` before, so its
/// coefficients become `c'_j = Σ_k M_jk c_k` with `M_jk = ∫ Y_j(d) Y_k(Q⁻¹ d) dd`. The integral is
/// computed by a quadrature that is exact for these degrees, for rotations and for reflections.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ShRotation {
    /// `M`, zero between degrees.
    matrix: [[f64; 16]; 16],
}

impl ShRotation {
    /// For the orthogonal matrix `turn`, row-major; its determinant may be −1.
    pub(super) fn of(turn: [[f64; 3]; 3]) -> Self {
        let mut matrix = [[0.0; 16]; 16];
        for [z, weight] in NODES {
            let ring = (1.0 - z * z).sqrt();
            for step in 0..AZIMUTHS {
                let azimuth = std::f64::consts::TAU * f64::from(step) / f64::from(AZIMUTHS);
                let d = [ring * azimuth.cos(), ring * azimuth.sin(), z];
                // The inverse of an orthogonal matrix is its transpose.
                let back = [0, 1, 2].map(|i| (0..3).map(|j| turn[j][i] * d[j]).sum::<f64>());
                let to = sh::basis(sh::MAX_DEGREE, d);
                let from = sh::basis(sh::MAX_DEGREE, back);
                let area = weight * std::f64::consts::TAU / f64::from(AZIMUTHS);
                for degree in 0..=sh::MAX_DEGREE {
                    let block = degree * degree..sh::num_coeffs(degree);
                    for j in block.clone() {
                        for k in block.clone() {
                            matrix[j][k] += area * to[j] * from[k];
                        }
                    }
                }
            }
        }
        Self { matrix }
    }

    /// Rotates the coefficients of one splat, `[K,3]`; degree 0 keeps its bits.
    pub(super) fn apply(&self, sh: &mut [[f32; 3]]) {
        let mut old = [[0.0; 3]; 16];
        for (old, rgb) in old.iter_mut().zip(sh.iter()) {
            *old = rgb.map(f64::from);
        }
        for (j, rgb) in sh.iter_mut().enumerate().skip(1) {
            for (channel, value) in rgb.iter_mut().enumerate() {
                let sum: f64 = (1..16).map(|k| self.matrix[j][k] * old[k][channel]).sum();
                *value = sum.as_f32();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::{quat, rotation_matrix};

    fn colour(coefficients: &[[f32; 3]], d: [f64; 3]) -> f64 {
        let basis = sh::basis(3, d);
        coefficients.iter().zip(basis).map(|(rgb, y)| f64::from(rgb[0]) * y).sum()
    }

    #[test]
    fn turned_splats_show_what_they_showed_before() {
        let coefficients: Vec<[f32; 3]> =
            (0..16_u8).map(|k| [0.3 - 0.05 * f32::from(k * 7 % 11), 0.0, 0.0]).collect();
        let turn = rotation_matrix(quat::normalize([0.3, -0.5, 0.2, 0.9_f64]));
        let mirror = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
        for q in [turn, mirror] {
            let mut turned = coefficients.clone();
            ShRotation::of(q).apply(&mut turned);
            for d in [[0.6, 0.0, 0.8], [0.0, -1.0, 0.0], [0.48, 0.6, 0.64]] {
                let to = q.map(|row| row[0] * d[0] + row[1] * d[1] + row[2] * d[2]);
                let (before, after) = (colour(&coefficients, d), colour(&turned, to));
                assert!((before - after).abs() < 1e-5, "{d:?}: {before} became {after}");
            }
            // Negative control: unturned coefficients show something else.
            let d = [0.48, 0.6, 0.64];
            let to = q.map(|row| row[0] * d[0] + row[1] * d[1] + row[2] * d[2]);
            let change = colour(&coefficients, to) - colour(&coefficients, d);
            assert!(change.abs() > 1e-2, "the test can fail: {change}");
        }
    }
}
