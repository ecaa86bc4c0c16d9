//! [`Similarity`]: rotation, uniform scale, translation, and mirroring.

use crate::rigid::RigidFit;
use gs_core::{Precision, Real, RowPrecision, ShRotation, Splats, quat, rotation_matrix};

/// `x ↦ s·R·(±x) + t`. Every similarity has this form: a reflection is a rotation after `x ↦ −x`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// `s`, above 0.
    pub scale: f64,
    /// `R`, unit quaternion `wxyz`.
    pub rotation: [f64; 4],
    /// Whether the sign is negative: handedness changes.
    pub mirrored: bool,
    /// `t`, world units.
    pub translation: [f64; 3],
}

impl Similarity {
    /// The identity.
    pub const IDENTITY: Self =
        Self { scale: 1.0, rotation: [1.0, 0.0, 0.0, 0.0], mirrored: false, translation: [0.0; 3] };

    /// Whether all values are finite, the scale is above 0 and the quaternion has unit length.
    pub fn is_valid(&self) -> bool {
        let unit = (quat::dot(self.rotation, self.rotation) - 1.0).abs() < 1e-6;
        unit && self.scale > 0.0
            && self.scale.is_finite()
            && self.translation.iter().all(|t| t.is_finite())
    }

    /// Image of a point, world frame and units.
    pub fn apply(&self, x: [f64; 3]) -> [f64; 3] {
        let rotated = self.apply_vector(x);
        [0, 1, 2].map(|k| rotated[k] + self.translation[k])
    }

    /// Image of a vector (difference of two points): without the translation.
    pub fn apply_vector(&self, d: [f64; 3]) -> [f64; 3] {
        let s = if self.mirrored { -self.scale } else { self.scale };
        quat::rotate(self.rotation, d).map(|v| s * v)
    }

    /// The inverse.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let back = Self {
            scale: 1.0 / self.scale,
            rotation: quat::conjugate(self.rotation),
            translation: [0.0; 3],
            ..*self
        };
        Self { translation: back.apply_vector(self.translation).map(|v| -v), ..back }
    }

    /// The composition: `first`, then this similarity.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            scale: self.scale * first.scale,
            rotation: quat::normalize(quat::mul(self.rotation, first.rotation)),
            mirrored: self.mirrored != first.mirrored,
            translation: self.apply(first.translation),
        }
    }

    /// The matrix of the orthogonal part, row-major; its determinant is −1 if mirrored.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        let sign = if self.mirrored { -1.0 } else { 1.0 };
        rotation_matrix(self.rotation).map(|row| row.map(|v| sign * v))
    }

    /// Splats transformed by this similarity: centres, rotations, scales and spherical harmonics;
    /// opacities are unchanged.
    ///
    /// An ellipsoid equals its own point reflection, so mirroring changes harmonics of odd degree
    /// only.
    #[must_use]
    pub fn transform(&self, splats: &Splats) -> Splats {
        let mut transformed = splats.clone();
        for mean in &mut transformed.means {
            *mean = self.apply(mean.map(f64::from)).map(Real::as_f32);
        }
        for q in &mut transformed.quats {
            *q = quat::mul(self.rotation, q.map(f64::from)).map(Real::as_f32);
        }
        let ln_scale = self.scale.ln();
        for log_scale in &mut transformed.log_scales {
            *log_scale = log_scale.map(|v| (f64::from(v) + ln_scale).as_f32());
        }
        if transformed.sh_degree > 0 {
            let (rotation, coeffs) =
                (ShRotation::orthogonal(self.matrix()), transformed.sh_coeffs());
            transformed.sh.chunks_exact_mut(coeffs).for_each(|sh| rotation.apply(sh));
        }
        transformed
    }

    /// Precision of `rows` rows that were stored with `precision` and then transformed by this
    /// similarity.
    #[must_use]
    pub fn transform_precision(&self, precision: &Precision, rows: usize) -> Precision {
        let (scale, ln_scale) = (self.scale.as_f32(), self.scale.ln().as_f32());
        let transformed = |row: usize| {
            let old = precision.of(row);
            // A rotated box is bounded by a ball; rotation mixes harmonics, and thereby their
            // rounding errors and ranges.
            let ball = scale * old.means.iter().map(|v| v * v).sum::<f32>().sqrt();
            RowPrecision {
                means: [ball; 3],
                log_scale_range: old.log_scale_range.map(|v| v + ln_scale),
                sh_rest: old.sh_rest.map(|v| 3.0 * v),
                sh_rest_range: [f32::NEG_INFINITY, f32::INFINITY],
                ..*old
            }
        };
        Precision::by_chunk((0..rows.max(1)).map(transformed).collect(), 1)
    }

    /// Least squares over pairs `x`, `y` (Horn's rotation, Umeyama's scale); `None` for fewer than
    /// three pairs, or collinear or coincident points, which do not determine the rotation.
    pub(crate) fn fit(pairs: &[([f64; 3], [f64; 3])], mirrored: bool) -> Option<Self> {
        if pairs.len() < 3 {
            return None;
        }
        let sign = if mirrored { -1.0 } else { 1.0 };
        let n = pairs.len() as f64;
        // Relative to the first pair: sums of coordinates far from the origin would lose precision.
        let (x0, y0) = pairs[0];
        let (mut from, mut to) = ([0.0; 3], [0.0; 3]);
        for (x, y) in pairs {
            for k in 0..3 {
                from[k] += (x[k] - x0[k]) / n;
                to[k] += (y[k] - y0[k]) / n;
            }
        }
        let from = [0, 1, 2].map(|k| x0[k] + from[k]);
        let to = [0, 1, 2].map(|k| y0[k] + to[k]);
        let mut fit = RigidFit::about([0.0; 3], [0.0; 3]);
        for (x, y) in pairs {
            let dx = [0, 1, 2].map(|k| sign * (x[k] - from[k]));
            fit.add(1.0, dx, [0, 1, 2].map(|k| y[k] - to[k]));
        }
        if fit.is_linear() {
            return None;
        }
        let rotation = fit.rotation(0.0);
        let found = Self { scale: fit.scale(rotation), rotation, mirrored, translation: [0.0; 3] };
        let moved = found.apply_vector(from);
        let found = Self { translation: [0, 1, 2].map(|k| to[k] - moved[k]), ..found };
        found.is_valid().then_some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn similarity() -> impl Strategy<Value = Similarity> {
        let component = -1.0..1.0_f64;
        (
            0.05..20.0_f64,
            [component.clone(), component.clone(), component.clone(), component],
            any::<bool>(),
            [-50.0..50.0_f64, -50.0..50.0, -50.0..50.0],
        )
            .prop_filter("a rotation", |(_, q, _, _)| quat::dot(*q, *q) > 0.01)
            .prop_map(|(scale, q, mirrored, translation)| Similarity {
                scale,
                rotation: quat::normalize(q),
                mirrored,
                translation,
            })
    }

    fn far(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
    }

    proptest! {
        #[test]
        fn inverse_and_composition_hold(a in similarity(), b in similarity(), x in [-9.0..9.0_f64, -9.0..9.0, -9.0..9.0]) {
            prop_assert!(far(a.inverse().apply(a.apply(x)), x) < 1e-9, "inverse");
            prop_assert!(far(a.after(&b).apply(x), a.apply(b.apply(x))) < 1e-8, "composition");
        }

        #[test]
        fn fits_recover_the_similarity(a in similarity()) {
            let points = [[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [0.1, 0.7, 0.3], [-0.4, 0.2, 1.0], [0.3, 0.3, -0.8]];
            let pairs = points.map(|x| (x, a.apply(x)));
            let found = Similarity::fit(&pairs, a.mirrored).unwrap();
            prop_assert!((found.scale / a.scale - 1.0).abs() < 1e-9, "{found:?} for {a:?}");
            for (x, y) in pairs {
                prop_assert!(far(found.apply(x), y) < 1e-8 * a.scale.max(1.0), "{found:?} for {a:?}");
            }
            // Negative control: the other handedness cannot fit these points.
            let other = Similarity::fit(&pairs, !a.mirrored).unwrap();
            let miss = pairs.iter().map(|(x, y)| far(other.apply(*x), *y)).fold(0.0, f64::max);
            prop_assert!(miss > 0.05 * a.scale, "{miss}");
        }
    }

    #[test]
    fn collinear_points_do_not_determine_a_rotation() {
        let line = [0.0, 1.0, 2.0, 3.0].map(|s| ([s, 2.0 * s, 0.0], [s, 2.0 * s, 0.0]));
        assert_eq!(Similarity::fit(&line, false), None, "undetermined");
    }
}
