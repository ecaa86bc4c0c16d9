//! [`Similarity::describe`]: description of a similarity for messages.

use crate::rigid::{norm, sub};
use crate::similarity::Similarity;
use gs_core::quat;

/// Smaller angles are not mentioned, radians: a twentieth of a degree.
const MIN_ANGLE: f64 = 9e-4;
/// Smaller relative changes of size are not mentioned.
const MIN_SCALE_CHANGE: f64 = 2e-4;
/// Smaller movements, as a share of the size, are not mentioned.
const MIN_SHIFT: f64 = 1e-3;
/// An axis within this distance of a coordinate axis is named after it.
const ALONG: f64 = 1e-4;
const AXES: [&str; 3] = ["x", "y", "z"];

impl Similarity {
    /// Description of the effect on an object of diameter `size` around `centre` (world units), as
    /// in "scaled by 1.3, rotated 180° about x"; "by less than can be seen" if the effect is
    /// invisible.
    pub fn describe(&self, centre: [f64; 3], size: f64) -> String {
        let mut words = Vec::new();
        let (mirror, rotation) = self.mirror_and_rotation();
        if let Some(axis) = mirror {
            words.push(format!("mirrored along {axis}"));
        }
        if (self.scale - 1.0).abs() > MIN_SCALE_CHANGE {
            words.push(format!("scaled by {}", rounded(self.scale, 4)));
        }
        words.extend(describe_rotation(rotation));
        let to = self.apply(centre);
        let shift = sub(to, centre);
        // Editors rotate and scale a selection about its centre, and a scene about the origin.
        let about_origin = norm(self.translation) <= MIN_SHIFT * size;
        if !about_origin && norm(shift) > MIN_SHIFT * size {
            let [x, y, z] = shift.map(|v| rounded(if v.abs() < 1e-4 * size { 0.0 } else { v }, 3));
            words.push(format!("moved by ({x}, {y}, {z})"));
        }
        if words.is_empty() { "by less than can be seen".to_owned() } else { words.join(", ") }
    }

    /// Whether the effect on an object of diameter `size` around `centre` (world units) is
    /// invisible: below the limits for mention in [`Similarity::describe`].
    pub fn is_negligible(&self, centre: [f64; 3], size: f64) -> bool {
        let shift = norm(sub(self.apply(centre), centre));
        !self.mirrored
            && (self.scale - 1.0).abs() <= MIN_SCALE_CHANGE
            && describe_rotation(self.rotation).is_none()
            && shift <= MIN_SHIFT * size
    }

    /// The mirrored axis, if there is one, and the rotation after mirroring. The axis is chosen to
    /// make the rotation as small as possible.
    fn mirror_and_rotation(&self) -> (Option<&'static str>, [f64; 4]) {
        if !self.mirrored {
            return (None, self.rotation);
        }
        // Mirroring along an axis equals a rotation by 180° about it and a point reflection.
        let rotation_by_180 = |axis: usize| {
            let mut q = [0.0; 4];
            q[axis + 1] = 1.0;
            q
        };
        let best = (0..3)
            .max_by(|&a, &b| self.rotation[a + 1].abs().total_cmp(&self.rotation[b + 1].abs()))
            .unwrap_or(0);
        let rotation = quat::mul(self.rotation, quat::conjugate(rotation_by_180(best)));
        (Some(AXES[best]), rotation)
    }
}

fn describe_rotation(rotation: [f64; 4]) -> Option<String> {
    let [w, x, y, z] = if rotation[0] < 0.0 { rotation.map(|c| -c) } else { rotation };
    let sine = norm([x, y, z]);
    let angle = 2.0 * sine.atan2(w);
    if angle < MIN_ANGLE {
        return None;
    }
    let axis = [x, y, z].map(|c| c / sine);
    let degrees = angle.to_degrees();
    let named = (0..3).find(|&k| 1.0 - axis[k].abs() < ALONG);
    let Some(k) = named else {
        let [x, y, z] = axis.map(|c| rounded(c, 3));
        return Some(format!("rotated {}° about ({x}, {y}, {z})", rounded(degrees, 4)));
    };
    let half = (degrees - 180.0).abs() < 0.05;
    let signed = if axis[k] < 0.0 && !half { -degrees } else { degrees };
    let up = k == 0 && (degrees - 90.0).abs() < 0.05;
    let note = if up { ": y and z exchanged as the upward axis" } else { "" };
    Some(format!("rotated {}° about {}{note}", rounded(signed, 4), AXES[k]))
}

/// `value` with `digits` significant digits and no trailing zeros.
fn rounded(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    let decimals = (digits as f64 - 1.0 - magnitude).clamp(0.0, 9.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=9")]
    let text = format!("{value:.0$}", decimals as usize);
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    };
    if text == "-0" { "0".to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described(scale: f64, rotation: [f64; 4], mirrored: bool, shift: [f64; 3]) -> String {
        let rotation = quat::normalize(rotation);
        Similarity { scale, rotation, mirrored, translation: shift }.describe([0.0; 3], 1.0)
    }

    #[test]
    fn similarities_are_described() {
        let (one, half) = ([1.0, 0.0, 0.0, 0.0], std::f64::consts::FRAC_1_SQRT_2);
        let still = [0.0; 3];
        for (found, expected) in [
            (described(1.0, one, false, still), "by less than can be seen"),
            (described(1.3, one, false, still), "scaled by 1.3"),
            (described(1.0, [0.0, 1.0, 0.0, 0.0], false, still), "rotated 180° about x"),
            (described(1.0, [0.0, 0.0, -1.0, 0.0], false, still), "rotated 180° about y"),
            (
                described(1.0, [half, -half, 0.0, 0.0], false, still),
                "rotated -90° about x: y and z exchanged as the upward axis",
            ),
            (described(1.0, [0.0, 0.0, 0.0, 1.0], true, still), "mirrored along z"),
            (described(1.0, one, false, [0.5, 0.0, -2.0]), "moved by (0.5, 0, -2)"),
            (
                described(0.01, [half, 0.0, half, 0.0], false, [0.0, 1.0, 0.0]),
                "scaled by 0.01, rotated 90° about y, moved by (0, 1, 0)",
            ),
            (
                described(1.0, [0.9, 0.1, 0.2, 0.3], false, still),
                "rotated 45.15° about (0.267, 0.535, 0.802)",
            ),
        ] {
            assert_eq!(found, expected, "description");
        }
    }

    #[test]
    fn scaling_about_the_centre_is_described_without_a_shift() {
        let scaled = Similarity {
            scale: 1.3,
            translation: [-0.3 * 2.0, -0.3 * -1.0, 0.0],
            ..Similarity::IDENTITY
        };
        assert_eq!(scaled.describe([2.0, -1.0, 0.0], 0.5), "scaled by 1.3", "in place");
        let about_origin = Similarity { scale: 2.0, ..Similarity::IDENTITY };
        assert_eq!(about_origin.describe([2.0, -1.0, 0.0], 0.5), "scaled by 2", "as a scene");
    }
}
