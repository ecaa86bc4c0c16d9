//! Screw motions: the warp of networks with six degrees of freedom.

use glam::{DVec3, Vec3};

/// Added to axis and moment after the division by the angle, as in training.
const OFFSET: f64 = 1e-5;

/// `x` under the screw motion of the twist `(w, v)`: with `θ = |w|`, axis `w/θ + 10⁻⁵` and moment
/// `v/θ + 10⁻⁵`, the matrix exponential of the twist at angle `θ` (equations 10 and 11 of Nerfies).
/// Without a rotation, the translation `v`.
pub(super) fn moved(x: [f32; 3], twist: [f32; 6]) -> [f32; 3] {
    let [w, v] = [[0, 1, 2], [3, 4, 5]].map(|range| wide(range.map(|k| twist[k])));
    let (x, angle) = (wide(x), w.length());
    let moved = if angle == 0.0 {
        x + v
    } else {
        let (axis, moment) = (w / angle + OFFSET, v / angle + OFFSET);
        let (sine, cosine) = angle.sin_cos();
        let (perpendicular, shifted) = (axis.cross(x), axis.cross(moment));
        let rotated = x + sine * perpendicular + (1.0 - cosine) * axis.cross(perpendicular);
        let translation =
            angle * moment + (1.0 - cosine) * shifted + (angle - sine) * axis.cross(shifted);
        rotated + translation
    };
    moved.as_vec3().to_array()
}

fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from(v).as_dvec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_rotation_and_translation() {
        let rotated =
            moved([1.0, 0.0, 0.0], [0.0, 0.0, std::f32::consts::FRAC_PI_2, 0.0, 0.0, 0.0]);
        for (found, expected) in rotated.into_iter().zip([0.0, 1.0, 0.0]) {
            assert!((found - expected).abs() < 1e-4, "{rotated:?}");
        }
        assert_eq!(moved([1.0; 3], [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]), [2.0, 3.0, 4.0], "no rotation");
    }
}
