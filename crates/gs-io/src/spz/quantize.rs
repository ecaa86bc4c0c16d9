//! Conversion between values and their bytes.

use super::layout::{COLOR_SCALE, LOG_SCALE_MIN, LOG_SCALE_STEPS};
use crate::bytes8::{largest_from, unorm8, without_largest};

/// Largest magnitude of a stored quaternion component, 9 bits.
const MAGNITUDE: f32 = 511.0;
const HALF_ROOT: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Largest signed 24-bit number.
pub(super) const MAX_FIXED: f32 = 8_388_607.0;

/// A 24-bit fixed-point number, little-endian, clamped to the range.
#[expect(clippy::cast_possible_truncation, reason = "clamped to 24 bits; NaN is 0")]
pub(super) fn fixed(value: f32, fractional_bits: u8) -> [u8; 3] {
    let scaled = (f64::from(value) * f64::from(1_u32 << fractional_bits)).round();
    let limit = f64::from(MAX_FIXED);
    let [a, b, c, _] = (scaled.clamp(-limit, limit) as i32).to_le_bytes();
    [a, b, c]
}

pub(super) fn from_fixed(bytes: [u8; 3], fractional_bits: u8) -> f32 {
    let [a, b, c] = bytes;
    let value = i32::from_le_bytes([0, a, b, c]) >> 8;
    value as f32 / (1_u32 << fractional_bits) as f32
}

pub(super) fn color(dc: f32) -> u8 {
    unorm8(dc * COLOR_SCALE + 0.5)
}

pub(super) fn from_color(byte: u8) -> f32 {
    (f32::from(byte) / 255.0 - 0.5) / COLOR_SCALE
}

pub(super) fn log_scale(value: f32) -> u8 {
    unorm8((value - LOG_SCALE_MIN) * LOG_SCALE_STEPS / 255.0)
}

pub(super) fn from_log_scale(byte: u8) -> f32 {
    f32::from(byte) / LOG_SCALE_STEPS + LOG_SCALE_MIN
}

/// An SH coefficient in `bits` of a byte, 1 to 8.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a byte")]
pub(super) fn harmonic(value: f32, bits: u32) -> u8 {
    let bucket = bucket(bits);
    let fine = (value * 128.0).round() + 128.0;
    ((fine / bucket).round() * bucket).clamp(0.0, 255.0) as u8
}

/// Number of byte values per step if `bits` bits are used.
pub(super) fn bucket(bits: u32) -> f32 {
    (1_u32 << (8 - bits.clamp(1, 8))) as f32
}

/// Bits that SH bytes use, determined from their common divisor. `None` if all bytes are 128
/// (zeros), from which the rounding cannot be determined.
pub(super) fn used_bits(bytes: impl Iterator<Item = u8>) -> Option<u32> {
    // 255 represents 256, which is clamped.
    let (all, zero) = bytes.fold((0, true), |(all, zero), byte| {
        (if byte == 255 { all } else { all | byte }, zero && byte == 128)
    });
    (!zero).then(|| 8 - all.trailing_zeros().min(7))
}

pub(super) fn from_harmonic(byte: u8) -> f32 {
    (f32::from(byte) - 128.0) / 128.0
}

/// A quaternion `xyzw`: slot of the largest in the top bits, then sign and magnitude of the others.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 9 bits")]
pub(super) fn smallest_three(xyzw: [f32; 4]) -> [u8; 4] {
    let (largest, others) = without_largest(xyzw);
    let slot = u32::try_from(largest).unwrap_or_default();
    let word = others.iter().fold(slot, |word, &q| {
        let magnitude = (q.abs() / HALF_ROOT * MAGNITUDE + 0.5).clamp(0.0, MAGNITUDE) as u32;
        word << 10 | u32::from(q < 0.0) << 9 | magnitude
    });
    word.to_le_bytes()
}

pub(super) fn from_smallest_three(bytes: [u8; 4]) -> [f32; 4] {
    let word = u32::from_le_bytes(bytes);
    let others = [20, 10, 0].map(|shift| {
        let magnitude = ((word >> shift) & 511) as f32 / MAGNITUDE * HALF_ROOT;
        if (word >> (shift + 9)) & 1 == 1 { -magnitude } else { magnitude }
    });
    largest_from(others, (word >> 30) as usize)
}

/// Half a step of a component of [`smallest_three`].
pub(super) fn smallest_three_component() -> f32 {
    0.5 / MAGNITUDE * HALF_ROOT
}

/// Half a step of a component of [`from_first_three`].
pub(super) const FIRST_THREE_COMPONENT: f32 = 0.5 / 127.5;

/// Version 2: x, y, z in bytes, w ≥ 0 from them.
pub(super) fn from_first_three(bytes: [u8; 3]) -> [f32; 4] {
    let [x, y, z] = bytes.map(|byte| f32::from(byte) / 127.5 - 1.0);
    [x, y, z, (1.0 - x * x - y * y - z * z).max(0.0).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_round_trip() {
        for value in [0.0, -0.000_13, 1.5, -2047.9, 2047.999] {
            let error = (from_fixed(fixed(value, 12), 12) - value).abs();
            assert!(error <= 0.5 / 4096.0 + 1e-4, "{value}: {error}");
        }
        assert_eq!(from_fixed(fixed(f32::INFINITY, 12), 12), MAX_FIXED / 4096.0, "beyond");
        assert_eq!(from_fixed(fixed(f32::NAN, 12), 12), 0.0, "hostile");
        for value in [-10.0, -3.21, 5.9] {
            assert!((from_log_scale(log_scale(value)) - value).abs() <= 1.0 / 32.0, "{value}");
        }
        for value in [-1.0, -0.3, 0.0, 0.07, 0.9] {
            assert!((from_harmonic(harmonic(value, 5)) - value).abs() <= 4.5 / 128.0, "{value}");
            assert!((from_harmonic(harmonic(value, 4)) - value).abs() <= 8.5 / 128.0, "{value}");
            assert!((from_harmonic(harmonic(value, 8)) - value).abs() <= 1.0 / 128.0, "{value}");
        }
        for bits in 1..=8 {
            let bytes = (0..200).map(|i| harmonic(i as f32 / 100.0 - 1.0, bits));
            assert_eq!(used_bits(bytes), Some(bits), "determined from the bytes");
        }
        assert_eq!(used_bits([128, 128].into_iter()), None, "not determined");
        for q in [[0.1, -0.8, 0.5, 0.2], [0.0, 0.0, 0.0, 1.0], [-0.5, 0.5, 0.5, -0.5]] {
            let (back, unit) =
                (from_smallest_three(smallest_three(q)), gs_core::quat::normalize(q));
            let angle = 2.0 * gs_core::quat::dot(back, unit).abs().min(1.0).acos();
            let allowed = crate::bytes8::smallest_three_rad(smallest_three_component());
            assert!(angle <= allowed, "{q:?}: {angle} > {allowed}");
        }
    }
}
