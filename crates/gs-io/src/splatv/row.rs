//! The 64 bytes of a splat.

use gs_core::sh;
use gs_deform::Polynomial;
use half::f16;

/// Bytes per splat.
pub(super) const BYTES: usize = 64;

/// Opacities are clamped to this distance from 0 and 1, so that their logits are finite.
const OPACITY_MARGIN: f32 = 1e-6;

/// A splat as stored in the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub(super) mean: [f32; 3],
    /// `wxyz`, raw.
    pub(super) quat: [f32; 4],
    /// Standard deviations, world units.
    pub(super) scale: [f32; 3],
    /// Red, green, blue, opacity in 255ths.
    pub(super) rgba: [u8; 4],
    pub(super) motion: Polynomial,
}

impl Row {
    pub(super) fn from_bytes(bytes: &[u8; BYTES]) -> Self {
        let word = |i: usize| [0, 1, 2, 3].map(|b| bytes[4 * i + b]);
        let half = |i: usize| f16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]).to_f32();
        let halves = |i: usize| [0, 1, 2].map(|k| half(i + k));
        Self {
            mean: [0, 1, 2].map(|i| f32::from_le_bytes(word(i))),
            quat: [0, 1, 2, 3].map(|k| half(6 + k)),
            scale: halves(10),
            rgba: word(7),
            motion: Polynomial {
                velocity: [halves(16), halves(19), halves(22)],
                omega: [0, 1, 2, 3].map(|k| half(26 + k)),
                centre: half(30),
                width: half(31),
            },
        }
    }

    pub(super) fn to_bytes(self) -> [u8; BYTES] {
        let mut bytes = [0; BYTES];
        for (k, value) in self.mean.into_iter().enumerate() {
            bytes[4 * k..4 * k + 4].copy_from_slice(&value.to_le_bytes());
        }
        bytes[28..32].copy_from_slice(&self.rgba);
        let mut halves = |first: usize, values: &[f32]| {
            for (k, &value) in values.iter().enumerate() {
                let at = 2 * (first + k);
                bytes[at..at + 2].copy_from_slice(&f16::from_f32(value).to_le_bytes());
            }
        };
        halves(6, &self.quat);
        halves(10, &self.scale);
        halves(16, self.motion.velocity.as_flattened());
        halves(26, &self.motion.omega);
        halves(30, &[self.motion.centre, self.motion.width]);
        bytes
    }

    /// Whether its motion is damaged: NaN, infinities, or a width in time that is not positive.
    pub(super) fn motion_is_damaged(&self) -> bool {
        let Polynomial { velocity, omega, centre, width } = &self.motion;
        let finite = velocity.as_flattened().iter().chain(omega).chain([centre]);
        !finite.into_iter().all(|value| value.is_finite()) || width.is_nan() || *width == 0.0
    }

    /// Whether a value exceeds half precision, or the rotation is zero.
    pub(super) fn is_damaged(&self) -> bool {
        let values = self.mean.iter().chain(&self.quat).chain(&self.scale);
        !values.into_iter().all(|value| value.is_finite())
            || self.quat == [0.0; 4]
            || self.motion_is_damaged()
    }

    /// Logarithms of the sizes; −∞ for size 0.
    pub(super) fn log_scale(&self) -> [f32; 3] {
        self.scale.map(|scale| scale.abs().ln())
    }

    pub(super) fn opacity_logit(&self) -> f32 {
        let opacity = f32::from(self.rgba[3]) / 255.0;
        gs_core::activation::logit(opacity.clamp(OPACITY_MARGIN, 1.0 - OPACITY_MARGIN))
    }

    pub(super) fn sh_dc(&self) -> [f32; 3] {
        let [r, g, b, _] = self.rgba;
        sh::dc_from_rgb([r, g, b].map(|level| f32::from(level) / 255.0))
    }
}

/// A value from 0 to 1 in 255ths; others are clamped.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
pub(super) fn level(value: f64) -> u8 {
    (value * 255.0).round().clamp(0.0, 255.0) as u8
}
