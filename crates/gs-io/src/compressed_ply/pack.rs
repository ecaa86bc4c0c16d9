//! Packing of numbers into the bits of a word.

use super::layout::{BITS, MAX_SH};
use crate::bytes8::{largest_from, without_largest};

/// √½, the upper bound of all components except the largest.
const HALF_ROOT: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// The largest number with `bits` bits.
pub(super) fn top(bits: u32) -> f32 {
    ((1_u32 << bits) - 1) as f32
}

/// `value` from 0 to 1 as a number of `bits` bits, rounded; NaN is 0.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the bits")]
fn unorm(value: f32, bits: u32) -> u32 {
    (value * top(bits) + 0.5).floor().clamp(0.0, top(bits)) as u32
}

fn from_unorm(word: u32, shift: u32, bits: u32) -> f32 {
    ((word >> shift) & ((1 << bits) - 1)) as f32 / top(bits)
}

/// Three numbers from 0 to 1 as 11, 10 and 11 bits, the first highest.
pub(super) fn vector(values: [f32; 3]) -> u32 {
    unorm(values[0], BITS[0]) << 21 | unorm(values[1], BITS[1]) << 11 | unorm(values[2], BITS[2])
}

pub(super) fn from_vector(word: u32) -> [f32; 3] {
    [from_unorm(word, 21, BITS[0]), from_unorm(word, 11, BITS[1]), from_unorm(word, 0, BITS[2])]
}

/// A quaternion `wxyz`: slot of its largest component in the top bits, then the others, 10 bits
/// each.
pub(super) fn rotation(quat: [f32; 4]) -> u32 {
    let (largest, others) = without_largest(quat);
    let slot = u32::try_from(largest).unwrap_or_default();
    others.iter().fold(slot, |word, &q| word << 10 | unorm(q * HALF_ROOT + 0.5, 10))
}

pub(super) fn from_rotation(word: u32) -> [f32; 4] {
    let others = [20, 10, 0].map(|shift| (from_unorm(word, shift, 10) - 0.5) / HALF_ROOT);
    largest_from(others, (word >> 30) as usize)
}

/// Half a step of a quaternion component.
pub(super) fn rotation_component() -> f32 {
    0.5 / top(10) / HALF_ROOT
}

/// An SH coefficient as a byte: the index of its bin.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a byte")]
pub(super) fn harmonic(value: f32) -> u8 {
    ((value / (2.0 * MAX_SH) + 0.5) * 256.0).clamp(0.0, 255.0) as u8
}

/// The centre of a bin; the end of the range for the first and last bin.
pub(super) fn from_harmonic(byte: u8) -> f32 {
    let unit = match byte {
        0 => 0.0,
        255 => 1.0,
        inner => (f32::from(inner) + 0.5) / 256.0,
    };
    (unit - 0.5) * 2.0 * MAX_SH
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_round_trip() {
        for values in [[0.0, 0.5, 1.0], [0.123, 0.999, 0.001]] {
            let back = from_vector(vector(values));
            for axis in 0..3 {
                let error = (back[axis] - values[axis]).abs();
                assert!(error <= 0.5001 / top(BITS[axis]), "{values:?} → {back:?}");
            }
        }
        for quat in [[1.0, 0.0, 0.0, 0.0], [0.1, -0.8, 0.5, 0.2], [-0.5, 0.5, 0.5, -0.5]] {
            let (back, unit) = (from_rotation(rotation(quat)), gs_core::quat::normalize(quat));
            let angle = 2.0 * gs_core::quat::dot(back, unit).abs().min(1.0).acos();
            let allowed = crate::bytes8::smallest_three_rad(rotation_component());
            assert!(angle <= allowed, "{quat:?}: {angle} > {allowed}");
        }
        for value in [-4.0, -1.3, 0.0, 0.02, 3.99, 4.0] {
            let error = (from_harmonic(harmonic(value)) - value).abs();
            assert!(error <= MAX_SH / 128.0, "{value}: {error}");
        }
        assert_eq!((vector([f32::NAN; 3]), harmonic(f32::NAN)), (0, 0), "hostile");
    }
}
