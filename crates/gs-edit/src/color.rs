//! Colours of splats: base colour, luma, hue, saturation, and the weight of a splat in statistics.

use gs_core::{Real, Splats, sh};

/// Luma weights of R, G and B (ITU-R BT.601), as in most splat editors.
pub(crate) const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

/// Base colour of splat `row`, `½ + C₀·dc`: its mean over all directions. Not clamped.
pub fn base_color(splats: &Splats, row: usize) -> [f64; 3] {
    let dc = splats.sh_of(row)[0];
    dc.map(|value| 0.5 + f64::from(sh::C0) * f64::from(value))
}

/// Weight of a splat in colour statistics: opacity times the product of its two largest standard
/// deviations, square world units. It is proportional to the area that the splat covers when seen
/// along its thin axis. 0 if it is not finite.
pub(crate) fn weight(splats: &Splats, row: usize) -> f64 {
    let mut scales = splats.log_scales[row].map(|value| f64::from(value).exp());
    scales.sort_by(f64::total_cmp);
    let weight = f64::from(splats.opacity(row)) * scales[1] * scales[2];
    if weight.is_finite() { weight } else { 0.0 }
}

/// Hue in degrees, 0 to 360 (`None` for greys), saturation and value of an RGB colour, HSV,
/// channels clamped to 0 to 1.
pub(crate) fn hsv(rgb: [f64; 3]) -> (Option<f64>, f64, f64) {
    let [r, g, b] = rgb.map(|c| c.clamp(0.0, 1.0));
    let (max, min) = (r.max(g).max(b), r.min(g).min(b));
    let chroma = max - min;
    if chroma.is_nan() || chroma < 1e-6 {
        return (None, 0.0, max);
    }
    let sixth = if max == r {
        ((g - b) / chroma).rem_euclid(6.0)
    } else if max == g {
        (b - r) / chroma + 2.0
    } else {
        (r - g) / chroma + 4.0
    };
    (Some(60.0 * sixth), chroma / max, max)
}

/// Weighted mean and covariance of colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ColorStats {
    pub(crate) mean: [f64; 3],
    pub(crate) covariance: [[f64; 3]; 3],
}

impl ColorStats {
    /// `None` if the weights sum to 0. Two passes, in the order given.
    pub(crate) fn of(colors: impl Iterator<Item = ([f64; 3], f64)> + Clone) -> Option<Self> {
        let (mut mean, mut total) = ([0.0; 3], 0.0);
        for (rgb, weight) in colors.clone() {
            total += weight;
            for c in 0..3 {
                mean[c] += weight * rgb[c];
            }
        }
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mean = mean.map(|sum| sum / total);
        let mut covariance = [[0.0; 3]; 3];
        for (rgb, weight) in colors {
            for a in 0..3 {
                for b in 0..3 {
                    covariance[a][b] += weight / total * (rgb[a] - mean[a]) * (rgb[b] - mean[b]);
                }
            }
        }
        Some(Self { mean, covariance })
    }

    /// Moments of the base colours of `rows`; if no splat has an area, all weights are equal.
    pub(crate) fn of_splats(splats: &Splats, rows: &[usize]) -> Option<Self> {
        let colors = |flat: bool| {
            rows.iter().map(move |&row| {
                (base_color(splats, row), if flat { 1.0 } else { weight(splats, row) })
            })
        };
        Self::of(colors(false)).or_else(|| Self::of(colors(true)))
    }
}

/// Writes a base colour.
pub(crate) fn set_base_color(splats: &mut Splats, row: usize, rgb: [f64; 3]) {
    let coeffs = splats.sh_coeffs();
    splats.sh[row * coeffs] = rgb.map(|c| ((c - 0.5) / f64::from(sh::C0)).as_f32());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_of_the_primaries() {
        for (rgb, hue) in [
            ([1.0, 0.0, 0.0], 0.0),
            ([1.0, 1.0, 0.0], 60.0),
            ([0.0, 0.5, 0.0], 120.0),
            ([0.0, 0.0, 1.0], 240.0),
            ([1.0, 0.0, 0.5], 330.0),
        ] {
            assert!((hsv(rgb).0.unwrap() - hue).abs() < 1e-9, "{rgb:?}");
        }
        assert_eq!(hsv([0.5; 3]), (None, 0.0, 0.5), "grey");
        assert_eq!(hsv([f64::NAN; 3]).0, None, "NaN");
    }
}
