//! Columns beyond the 3DGS layout that affect the appearance of splats.
//!
//! | columns | written by | interpretation |
//! |---|---|---|
//! | `filter_3D` | Mip-Splatting | activated: s′ = √(s² + f²), o′ = o·Πs/Πs′ |
//! | `red green blue` without `f_dc_*` | nerfstudio (RGB), converters | degree-0 SH of that colour |
//! | no `scale_2` | 2DGS, surfels | a thin disc |
//! | only `scale_0` | trainers of isotropic splats | a ball |
//! | `f_rest_*` of degree 4 and above | newer trainers | the coefficients of degree 3 |

use super::header::{Element, PropertyKind, Scalar};
use gs_core::Splats;
use gs_core::activation::{logit, sigmoid};
use gs_core::sh::{C0, MAX_DEGREE};

/// Colour columns used instead of `f_dc_*`.
pub(super) const RGB: [&str; 3] = ["red", "green", "blue"];
/// Column of the smoothing filter of Mip-Splatting, world units.
pub(super) const FILTER: &str = "filter_3D";
/// Log-scale of the missing axis of surfels: a thickness of
/// 10⁻⁶ world units, as in their own viewers.
const SURFEL_LOG_SCALE: f32 = -13.815_511;
/// Comment that requests Mip-Splatting's rendering.
const MIP_COMMENT: &str = "splatrendermode: mip";
/// Note on splats that were trained with antialiasing.
const ANTIALIASED: &str = "trained with antialiasing (Mip-Splatting's 2D filter), which is not \
                          supported: splats smaller than a pixel look larger than in their own \
                          viewer";

/// Properties of the columns beyond the 3DGS layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Appearance {
    /// Type of the colour columns, if they replace SH of degree 0.
    pub(super) rgb: Option<Scalar>,
    /// Whether the third axis is missing.
    pub(super) surfels: bool,
    /// Whether one scale applies to all axes.
    pub(super) isotropic: bool,
    /// Whether there is a filter; its column is then the last.
    pub(super) filter: bool,
    /// SH degree of the file, if it is higher than the degree read.
    pub(super) cut_degree: Option<usize>,
}

/// Type of a scalar column.
pub(super) fn scalar_type(element: &Element, column: usize) -> Option<Scalar> {
    match element.properties.get(column)?.kind {
        PropertyKind::Scalar(scalar) => Some(scalar),
        PropertyKind::List { .. } => None,
    }
}

impl Appearance {
    /// Notes on the interpretation, one sentence each.
    pub(super) fn notes(&self, comments: &[String]) -> Vec<String> {
        let mut notes = Vec::new();
        if self.rgb.is_some() {
            notes.push(
                "colours are read from red, green and blue, because it has no f_dc \
                columns"
                    .to_owned(),
            );
        }
        if self.surfels {
            notes.push(
                "it has no scale_2 (2D Gaussians): splats are read as discs with a thickness of \
                1e-6 units"
                    .to_owned(),
            );
        }
        if self.isotropic {
            notes.push("it has a single scale: splats are read as spheres of that size".to_owned());
        }
        if self.filter {
            notes.push(
                "the smoothing filter of Mip-Splatting (filter_3D) was applied to sizes and opacities"
                    .to_owned(),
            );
        }
        if let Some(degree) = self.cut_degree {
            notes.push(format!("SH degree {degree} was cut to {MAX_DEGREE}"));
        }
        let asks = |comment: &String| comment.trim().eq_ignore_ascii_case(MIP_COMMENT);
        if self.filter || comments.iter().any(asks) {
            notes.push(ANTIALIASED.to_owned());
        }
        notes
    }

    /// Converts the stored values of the columns to those of the 3DGS layout; `filters[row]` are
    /// world units, empty without a filter.
    pub(super) fn apply(&self, splats: &mut Splats, filters: &[f32]) {
        if let Some(scalar) = self.rgb {
            let coeffs = splats.sh_coeffs();
            let white = white(scalar, splats.sh.iter().step_by(coeffs).flatten().copied());
            for dc in splats.sh.iter_mut().step_by(coeffs) {
                *dc = dc.map(|channel| (channel / white - 0.5) / C0);
            }
        }
        if self.surfels {
            for log_scale in &mut splats.log_scales {
                log_scale[2] = SURFEL_LOG_SCALE;
            }
        }
        for (row, &filter) in filters.iter().enumerate() {
            smooth(&mut splats.log_scales[row], &mut splats.opacity_logits[row], filter);
        }
    }
}

/// The number for full intensity. For floating-point colours it
/// is 1, or 255 if one of them is above 1.
fn white(scalar: Scalar, mut channels: impl Iterator<Item = f32>) -> f32 {
    match scalar {
        Scalar::U16 | Scalar::I16 => 65535.0,
        Scalar::F32 | Scalar::F64 => {
            if channels.any(|channel| channel > 1.0 && channel.is_finite()) { 255.0 } else { 1.0 }
        }
        Scalar::I8 | Scalar::U8 | Scalar::I32 | Scalar::U32 => 255.0,
    }
}

/// Applies the 3D smoothing filter of Mip-Splatting (Yu et al. 2024, equation 9) of standard
/// deviation `filter` to a splat.
fn smooth(log_scale: &mut [f32; 3], opacity_logit: &mut f32, filter: f32) {
    if filter == 0.0 {
        return;
    }
    let log_filter = f64::from(filter).abs().ln();
    // Logarithm of Πs/Πs′.
    let mut log_ratio = 0.0;
    for axis in log_scale {
        let stored = f64::from(*axis);
        // √(s² + f²) computed with logarithms, so that sizes of any magnitude stay finite.
        let larger = stored.max(log_filter);
        let square = |log: f64| (2.0 * (log - larger)).exp();
        let smoothed = larger + 0.5 * (square(stored) + square(log_filter)).ln();
        log_ratio += stored - smoothed;
        *axis = single(smoothed);
    }
    let opacity = sigmoid(f64::from(*opacity_logit)) * log_ratio.exp();
    *opacity_logit = single(logit(opacity));
}

#[expect(clippy::cast_possible_truncation, reason = "Gaussians are single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_applies_to_activated_values() {
        let (mut log_scale, mut opacity_logit) = ([-3.0, -2.5, -2.0], 1.5);
        smooth(&mut log_scale, &mut opacity_logit, 0.2);
        let mut ratio = 1.0;
        for (stored, found) in [-3.0_f64, -2.5, -2.0].into_iter().zip(log_scale) {
            let (s, expected) = (stored.exp(), stored.exp().hypot(0.2));
            assert!((f64::from(found).exp() - expected).abs() < 1e-7, "{found}");
            ratio *= s / expected;
        }
        let expected = ratio / (1.0 + (-1.5_f64).exp());
        assert!((sigmoid(f64::from(opacity_logit)) - expected).abs() < 1e-7, "{opacity_logit}");
    }

    #[test]
    fn infinities_are_smoothed() {
        let opaque = |filter: f32| {
            let (mut log_scale, mut logit) = ([-2.0; 3], f32::INFINITY);
            smooth(&mut log_scale, &mut logit, filter);
            (log_scale, logit)
        };
        let expected = ((-2.0_f64).exp() / (-2.0_f64).exp().hypot(0.2)).powi(3);
        assert!(
            (sigmoid(f64::from(opaque(0.2).1)) - expected).abs() < 1e-7,
            "opaque splats become less opaque"
        );
        assert_eq!(opaque(0.0), ([-2.0; 3], f32::INFINITY), "no filter");
        assert!(opaque(f32::NAN).1.is_nan(), "damaged values remain damaged");
        let (mut log_scale, mut logit) = ([f32::NEG_INFINITY, -2.0, -2.0], 3.0);
        smooth(&mut log_scale, &mut logit, 0.2);
        assert!(
            (log_scale[0] - 0.2_f32.ln()).abs() < 1e-6,
            "flat splats get the thickness of the \
            filter"
        );
        assert_eq!(logit, f32::NEG_INFINITY, "and opacity 0");
    }

    #[test]
    fn full_intensity_by_type() {
        assert_eq!(white(Scalar::U8, [1.0].into_iter()), 255.0, "bytes");
        assert_eq!(white(Scalar::U16, [1.0].into_iter()), 65535.0, "16 bits");
        assert_eq!(white(Scalar::F32, [0.0, 1.0].into_iter()), 1.0, "unit");
        assert_eq!(white(Scalar::F64, [0.0, 200.0].into_iter()), 255.0, "bytes as numbers");
    }
}
