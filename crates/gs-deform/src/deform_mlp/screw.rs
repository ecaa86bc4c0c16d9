//! Screw motions: the warp of networks with six degrees of freedom.

/// Added to axis and moment after the division by the angle, as in training.
const OFFSET: f64 = 1e-5;

/// `x` under the screw motion of the twist `(w, v)`: with `θ = |w|`, axis `w/θ + 10⁻⁵` and moment
/// `v/θ + 10⁻⁵`, the matrix exponential of the twist at angle `θ` (equations 10 and 11 of Nerfies).
/// Without a rotation, the translation `v`.
pub(super) fn moved(x: [f32; 3], twist: [f32; 6]) -> [f32; 3] {
    let [wx, wy, wz, vx, vy, vz] = twist.map(f64::from);
    let x = x.map(f64::from);
    let angle = (wx * wx + wy * wy + wz * wz).sqrt();
    let out = if angle == 0.0 {
        [x[0] + vx, x[1] + vy, x[2] + vz]
    } else {
        let axis = [wx, wy, wz].map(|component| component / angle + OFFSET);
        let moment = [vx, vy, vz].map(|component| component / angle + OFFSET);
        let (sine, cosine) = angle.sin_cos();
        let (turned, turned_twice) = (cross(axis, x), cross(axis, cross(axis, x)));
        let (shifted, shifted_twice) = (cross(axis, moment), cross(axis, cross(axis, moment)));
        [0, 1, 2].map(|k| {
            let rotated = x[k] + sine * turned[k] + (1.0 - cosine) * turned_twice[k];
            let translation =
                angle * moment[k] + (1.0 - cosine) * shifted[k] + (angle - sine) * shifted_twice[k];
            rotated + translation
        })
    };
    #[expect(clippy::cast_possible_truncation, reason = "positions are single precision")]
    let out = out.map(|component| component as f32);
    out
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_turn_and_limit() {
        let turned = moved([1.0, 0.0, 0.0], [0.0, 0.0, std::f32::consts::FRAC_PI_2, 0.0, 0.0, 0.0]);
        for (found, expected) in turned.into_iter().zip([0.0, 1.0, 0.0]) {
            assert!((found - expected).abs() < 1e-4, "{turned:?}");
        }
        assert_eq!(moved([1.0; 3], [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]), [2.0, 3.0, 4.0], "no rotation");
    }
}
