//! [`ColorMap`]: affine maps of colour, exact on spherical harmonics.

use crate::color::LUMA;
use gs_core::{Real, sh};

/// `c ↦ M·c + o` on RGB.
///
/// A splat's colour in direction `d` is `c(d) = ½ + Σ_k Y_k(d)·s_k`. With `s_k' = M·s_k` (k ≥ 1)
/// and `s_0' = M·s_0 + (M·½ + o − ½)/C₀` it becomes `M·c(d) + o` in every direction. The same
/// holds for every pixel composited over black: `Σ w_i (M·c_i + o) = M·Σ w_i c_i + o·Σ w_i`.
/// Rasterisers clamp a splat's colour at 0 before they composite it; for colours below 0, before or
/// after the map, the equality does not hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorMap {
    /// `M`, row-major, no unit.
    pub matrix: [[f64; 3]; 3],
    /// `o`, unit of colours (0 to 1).
    pub offset: [f64; 3],
}

impl ColorMap {
    /// The identity.
    pub const IDENTITY: Self =
        Self { matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], offset: [0.0; 3] };

    /// Rotation by `degrees` about the grey axis `(1,1,1)/√3`:
    /// `cos θ·I + (1−cos θ)/3·J + sin θ/√3·K`, `J` all ones, `K·c = (1,1,1) × c`. Greys and the
    /// mean of the channels do not change; 120° maps red to green, like a hue shift in HSV.
    pub fn hue(degrees: f64) -> Self {
        let (sin, cos) = degrees.rem_euclid(360.0).to_radians().sin_cos();
        let (even, odd) = ((1.0 - cos) / 3.0, sin / 3.0_f64.sqrt());
        let (a, b, c) = (cos + even, even - odd, even + odd);
        Self { matrix: [[a, b, c], [c, a, b], [b, c, a]], offset: [0.0; 3] }
    }

    /// `c ↦ luma(c)·1 + factor·(c − luma(c)·1)`; 0 gives grey, 1 is the identity.
    pub fn saturation(factor: f64) -> Self {
        let mut matrix = [[0.0; 3]; 3];
        for (a, row) in matrix.iter_mut().enumerate() {
            for (b, value) in row.iter_mut().enumerate() {
                *value = (1.0 - factor) * LUMA[b] + if a == b { factor } else { 0.0 };
            }
        }
        Self { matrix, offset: [0.0; 3] }
    }

    /// `c ↦ c + amount`.
    pub fn brightness(amount: f64) -> Self {
        Self { offset: [amount; 3], ..Self::IDENTITY }
    }

    /// `c ↦ (c − black)/(white − black)`.
    pub fn levels(black: f64, white: f64) -> Self {
        let gain = 1.0 / (white - black);
        Self { offset: [-black * gain; 3], ..Self::diagonal([gain; 3]) }
    }

    /// `c ↦ c ∘ (1 − strength + strength·rgb)`: as under light of that colour.
    pub fn tint(rgb: [f64; 3], strength: f64) -> Self {
        Self::diagonal(rgb.map(|c| 1.0 - strength + strength * c))
    }

    /// `c ↦ rgb·luma(c)/mean_luma`, mixed with the identity: `rgb` at the mean luma, with the same
    /// shading. If the mean is below half a step of 8 bits, there is no shading, and all splats get
    /// the colour itself.
    pub fn color(rgb: [f64; 3], strength: f64, mean_luma: f64) -> Self {
        let shaded = mean_luma > 0.5 / 255.0;
        let full = if shaded {
            Self { matrix: rgb.map(|c| LUMA.map(|w| c * w / mean_luma)), offset: [0.0; 3] }
        } else {
            Self { matrix: [[0.0; 3]; 3], offset: rgb }
        };
        full.mixed(strength)
    }

    fn diagonal([r, g, b]: [f64; 3]) -> Self {
        Self { matrix: [[r, 0.0, 0.0], [0.0, g, 0.0], [0.0, 0.0, b]], offset: [0.0; 3] }
    }

    /// `(1 − strength)·c + strength·self(c)`.
    #[must_use]
    pub fn mixed(&self, strength: f64) -> Self {
        let mix = |a: f64, b: f64| (1.0 - strength) * a + strength * b;
        let mut mixed = *self;
        for (row, identity) in mixed.matrix.iter_mut().zip(Self::IDENTITY.matrix) {
            for (value, identity) in row.iter_mut().zip(identity) {
                *value = mix(identity, *value);
            }
        }
        mixed.offset = self.offset.map(|o| mix(0.0, o));
        mixed
    }

    /// `M·c + o`.
    pub fn apply(&self, rgb: [f64; 3]) -> [f64; 3] {
        let turned = self.apply_linear(rgb);
        [0, 1, 2].map(|c| turned[c] + self.offset[c])
    }

    /// `M·c`.
    pub fn apply_linear(&self, rgb: [f64; 3]) -> [f64; 3] {
        self.matrix.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2])
    }

    /// Coefficients `[K,3]` of one splat, DC first, in place.
    pub fn apply_sh(&self, coeffs: &mut [[f32; 3]]) {
        let c0 = f64::from(sh::C0);
        let grey = self.apply([0.5; 3]).map(|c| (c - 0.5) / c0);
        for (k, rgb) in coeffs.iter_mut().enumerate() {
            let mut mapped = self.apply_linear(rgb.map(f64::from));
            if k == 0 {
                mapped = [0, 1, 2].map(|c| mapped[c] + grey[c]);
            }
            *rgb = mapped.map(Real::as_f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|c| (a[c] - b[c]).abs() < 1e-12)
    }

    #[test]
    fn maps_agree_with_their_definitions() {
        let red = [1.0, 0.0, 0.0];
        assert!(close(ColorMap::hue(120.0).apply(red), [0.0, 1.0, 0.0]), "red becomes green");
        assert!(close(ColorMap::hue(-120.0).apply(red), [0.0, 0.0, 1.0]), "red becomes blue");
        assert!(close(ColorMap::hue(77.0).apply([0.4; 3]), [0.4; 3]), "grey stays");
        assert!(close(ColorMap::saturation(0.0).apply(red), [0.299; 3]), "grey of its luma");
        assert!(
            close(ColorMap::levels(0.2, 0.7).apply([0.2, 0.45, 0.7]), [0.0, 0.5, 1.0]),
            "levels"
        );
        assert!(
            close(ColorMap::tint([0.5, 1.0, 0.0], 0.5).apply([1.0; 3]), [0.75, 1.0, 0.5]),
            "tint"
        );
        let target = [0.9, 0.2, 0.1];
        let recolor = ColorMap::color(target, 1.0, 0.3);
        assert!(close(recolor.apply([0.3; 3]), target), "the mean gets the colour");
        assert!(close(recolor.apply([0.15; 3]), target.map(|c| c / 2.0)), "shade stays shade");
        assert!(close(ColorMap::color(target, 1.0, 0.0).apply([0.0; 3]), target), "black, too");
        assert_eq!(recolor.mixed(0.0).matrix, ColorMap::IDENTITY.matrix, "no strength");
    }

    #[test]
    fn maps_are_exact_on_harmonics_in_every_direction() {
        let map = ColorMap { offset: [0.1, -0.2, 0.05], ..ColorMap::hue(40.0) };
        let before: Vec<[f32; 3]> =
            (0..16_u8).map(|k| [0.1 * f32::from(k), -0.05 * f32::from(k), 0.3]).collect();
        let mut after = before.clone();
        map.apply_sh(&mut after);
        for direction in [[0.0, 0.0, 1.0], [0.48, -0.6, 0.64], [-0.6, 0.8, 0.0]] {
            let color = |sh: &[[f32; 3]]| -> [f64; 3] {
                let sh: Vec<[f64; 3]> = sh.iter().map(|rgb| rgb.map(f64::from)).collect();
                gs_core::sh::color(3, &sh, direction)
            };
            let (expected, found) = (map.apply(color(&before)), color(&after));
            assert!(
                (0..3).all(|c| (expected[c] - found[c]).abs() < 1e-6),
                "{expected:?} {found:?}"
            );
        }
    }
}
