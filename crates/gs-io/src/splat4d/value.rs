//! Attributes of a splat as numbers on grids.

use super::WriteOptions;
use crate::clip::Hemispheres;
use gs_core::{Splats, sh};

/// Attribute of a splat, numbered as in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Attribute {
    Pos = 0,
    Rot = 1,
    Rgb = 2,
    Alpha = 3,
    Scale = 4,
}

impl Attribute {
    /// In the order of their numbers.
    pub(super) const ALL: [Self; 5] = [Self::Pos, Self::Rot, Self::Rgb, Self::Alpha, Self::Scale];

    pub(super) fn id(self) -> u8 {
        self as u8
    }

    pub(super) fn channels(self) -> usize {
        match self {
            Self::Pos | Self::Rgb | Self::Scale => 3,
            Self::Rot => 4,
            Self::Alpha => 1,
        }
    }
}

/// The attribute's values in grid units' domain: world units; 128ths minus the file's offset;
/// 255ths; log world units. Unused channels are 0. Exact in single precision.
pub(super) fn values(
    attribute: Attribute,
    splats: &Splats,
    hemispheres: &Hemispheres,
    row: usize,
) -> [f32; 4] {
    let three = |[a, b, c]: [f32; 3]| [a, b, c, 0.0];
    match attribute {
        Attribute::Pos => three(splats.means[row]),
        Attribute::Rot => {
            hemispheres.get(row).map(|component| (component * 128.0).round().clamp(-128.0, 127.0))
        }
        Attribute::Rgb => {
            let dc = splats.sh[row * splats.sh_coeffs()];
            three(dc.map(|dc| byte(0.5 + sh::C0 * dc)))
        }
        Attribute::Alpha => [byte(splats.opacity(row)), 0.0, 0.0, 0.0],
        Attribute::Scale => three(splats.log_scales[row]),
    }
}

fn byte(value: f32) -> f32 {
    (value * 255.0).round().clamp(0.0, 255.0)
}

/// Grid steps of changing values, and of values stored once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps {
    bounds: [f64; 5],
    moving: [f64; 5],
    fixed: [f64; 5],
}

impl Steps {
    pub(super) fn new(options: &WriteOptions, position_bound: f64) -> Self {
        let [rot, rgb, alpha] = [options.rot, options.rgb, options.alpha].map(f64::from);
        // A scene without extent has one position, so any step is valid.
        let pos = if position_bound > 0.0 { position_bound } else { f64::from(f32::MIN_POSITIVE) };
        let scale = options.scale.ln_1p();
        Self {
            bounds: [pos, rot, rgb, alpha, scale],
            moving: [2.0 * pos, 2.0 * rot + 1.0, 2.0 * rgb + 1.0, 2.0 * alpha + 1.0, 2.0 * scale],
            fixed: [pos, 1.0, 1.0, 1.0, scale],
        }
    }

    pub(super) fn bound(&self, attribute: Attribute) -> f64 {
        self.bounds[attribute as usize]
    }

    pub(super) fn moving(&self, attribute: Attribute) -> f64 {
        self.moving[attribute as usize]
    }

    pub(super) fn fixed(&self, attribute: Attribute) -> f64 {
        self.fixed[attribute as usize]
    }

    /// Index of the grid point closest to `value`.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "ValueRanges::check_range has verified every value that is written"
    )]
    pub(super) fn bin(value: f32, step: f64) -> i32 {
        (f64::from(value) / step).round() as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_points_are_within_their_bound() {
        let options = WriteOptions { rgb: 4, rot: 1, ..WriteOptions::default() };
        let steps = Steps::new(&options, 0.25);
        for attribute in Attribute::ALL {
            let (step, bound) = (steps.moving(attribute), steps.bound(attribute));
            for i in -128..=255_i16 {
                let value = f32::from(i);
                let error = f64::from(value) - f64::from(Steps::bin(value, step)) * step;
                assert!(error.abs() <= bound + 1e-9, "{attribute:?} {value}: off by {error}");
            }
        }
    }
}
