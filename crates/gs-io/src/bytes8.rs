//! Encodings shared by several formats: values in a byte, quaternions in three small numbers.

use gs_core::activation::logit;
use gs_core::sh::C0;

/// Opacity logit of a byte. The end values represent all opacities that round to them; they get the
/// logit of the middle of that range (about ∓6.9) instead of an infinite one.
pub(crate) fn logit_of(byte: u8) -> f32 {
    let opacity = match byte {
        0 => 0.25,
        255 => 254.75,
        inner => f32::from(inner),
    };
    logit(opacity / 255.0)
}

/// A note with the number of opacities stored as 0 or 255.
pub(crate) fn ends_note(bytes: impl Iterator<Item = u8>) -> Option<String> {
    let ends = bytes.filter(|&byte| byte == 0 || byte == 255).count();
    (ends > 0)
        .then(|| format!("{ends} opacities stored as exactly 0 or 1 were read as 0.001 or 0.999"))
}

/// DC coefficient of a colour channel from 0 to 1.
pub(crate) fn dc_of(channel: f32) -> f32 {
    (channel - 0.5) / C0
}

/// Colour channel of a DC coefficient; 0 to 1 is the displayable range.
pub(crate) fn channel_of(dc: f32) -> f32 {
    0.5 + C0 * dc
}

/// `value` from 0 to 1 as a byte, rounded; NaN is 0.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a byte")]
pub(crate) fn unorm8(value: f32) -> u8 {
    (value * 255.0 + 0.5).clamp(0.0, 255.0) as u8
}

/// The unit quaternion with components `others`, in order, and
/// a positive component in slot `largest`.
pub(crate) fn largest_from(others: [f32; 3], largest: usize) -> [f32; 4] {
    let squares: f32 = others.iter().map(|q| q * q).sum();
    let mut rest = others.into_iter();
    std::array::from_fn(|slot| {
        if slot == largest {
            (1.0 - squares).max(0.0).sqrt()
        } else {
            rest.next().unwrap_or_default()
        }
    })
}

/// The slot of the largest component, and the other components with the sign that makes it
/// positive; those of the identity for a zero quaternion.
pub(crate) fn without_largest(quat: [f32; 4]) -> (usize, [f32; 3]) {
    let unit = gs_core::quat::normalize(quat);
    let mut largest = 0;
    for slot in 1..4 {
        if unit[slot].abs() > unit[largest].abs() {
            largest = slot;
        }
    }
    let sign = if unit[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut others = (0..4).filter(|&slot| slot != largest).map(|slot| sign * unit[slot]);
    (largest, std::array::from_fn(|_| others.next().unwrap_or_default()))
}

/// Largest error of a rotation, radians, if the error of each of the
/// three smaller components is at most `component`:
/// |δq| ≤ √12·component, since the largest is at least 1/2, and the angle is twice that.
pub(crate) fn smallest_three_rad(component: f32) -> f32 {
    2.0 * 12.0_f32.sqrt() * component
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternions_are_restored_from_their_smaller_components() {
        for quat in [[0.1, -0.9, 0.3, 0.2], [0.5, 0.5, -0.5, 0.5], [0.0, 0.0, 0.0, -2.0]] {
            let (largest, others) = without_largest(quat);
            let back = largest_from(others, largest);
            let unit = gs_core::quat::normalize(quat);
            assert!(gs_core::quat::dot(back, unit).abs() > 1.0 - 1e-6, "{quat:?} → {back:?}");
        }
        assert_eq!(largest_from(without_largest([0.0; 4]).1, 0), [1.0, 0.0, 0.0, 0.0], "zero");
    }

    #[test]
    fn bytes_give_finite_logits() {
        assert!(logit_of(0).is_finite() && logit_of(255).is_finite(), "ends");
        for byte in 0..=255 {
            assert_eq!(unorm8(gs_core::activation::sigmoid(logit_of(byte))), byte, "{byte}");
        }
        assert_eq!((unorm8(f32::NAN), unorm8(9.0), unorm8(-9.0)), (0, 255, 0), "hostile");
        assert!(ends_note([0, 3, 255].into_iter()).unwrap().starts_with("2 "), "counted");
    }
}
