//! [`PictureLoss`]: L1 and D-SSIM of a render against a picture.

use c4d_metrics::{SSIM_RADIUS, Ssim};
use gs_core::TileSet;
use rayon::prelude::*;

/// Target of a render, `[H,W,3]` of the whole image.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// Image columns.
    pub width: usize,
    /// Image rows.
    pub height: usize,
    /// Colours, `[H,W,3]`.
    pub rgb: &'a [f32],
    /// Weight of each pixel, 0 or more, `[H,W]`; empty for 1 everywhere. For D-SSIM, weights are
    /// clamped to 1.
    pub weights: &'a [f32],
    /// The part of the image that is compared; all other pixels count as equal to the target.
    pub tiles: &'a TileSet,
}

/// `(1 − s)·mean w|x − y| + s·mean(1 − SSIM)` and its gradient; means over the whole image. Owns
/// its work memory.
///
/// Where the weight is below 1, SSIM compares with a blend of target and render, so that pixels of
/// weight 0 have no influence.
#[derive(Debug, Clone)]
pub struct PictureLoss {
    /// Share of D-SSIM.
    share: f32,
    ssim: Ssim<f32>,
    x: Vec<f32>,
    y: Vec<f32>,
    v: Vec<f32>,
}

impl PictureLoss {
    /// A loss with this share of D-SSIM, 0 to 1.
    pub fn new(share: f32) -> Self {
        Self { share, ssim: Ssim::new(0, 0, 3), x: Vec::new(), y: Vec::new(), v: Vec::new() }
    }

    /// The loss of `render` (`[H,W,3]`); overwrites `v_render` (`[H,W,3]`) with its derivative.
    ///
    /// # Panics
    /// If lengths do not fit the size.
    pub fn evaluate(&mut self, render: &[f32], target: &Target, v_render: &mut Vec<f32>) -> f32 {
        let &Target { width, height, rgb, weights, tiles } = target;
        let pixels = width * height;
        assert!(
            render.len() == 3 * pixels
                && rgb.len() == 3 * pixels
                && (weights.is_empty() || weights.len() == pixels),
            "picture loss: {} and {} values, {} weights, {width}×{height} pixels",
            render.len(),
            rgb.len(),
            weights.len()
        );
        v_render.clear();
        v_render.resize(3 * pixels, 0.0);
        if tiles.is_empty() {
            return 0.0;
        }
        // Windows of SSIM around the compared pixels.
        let [x0, y0, x1, y1] = tiles.bounds();
        let (x0, y0) = (x0.saturating_sub(SSIM_RADIUS), y0.saturating_sub(SSIM_RADIUS));
        let columns = (x1 + SSIM_RADIUS).min(width) - x0;
        let rows = (y1 + SSIM_RADIUS).min(height) - y0;
        let len = 3 * columns * rows;
        for plane in [&mut self.x, &mut self.y, &mut self.v] {
            plane.clear();
            plane.resize(len, 0.0);
        }
        let norm = 1.0 / (3 * pixels) as f32;
        let factor = norm * (1.0 - self.share);
        let row_sums: Vec<f32> = self
            .x
            .par_chunks_mut(3 * columns)
            .zip(self.y.par_chunks_mut(3 * columns))
            .zip(self.v.par_chunks_mut(3 * columns))
            .enumerate()
            .map(|(row, ((x, y), v))| {
                let first = (y0 + row) * width + x0;
                x.copy_from_slice(&rgb[3 * first..3 * (first + columns)]);
                y.copy_from_slice(&rgb[3 * first..3 * (first + columns)]);
                let mut sum = 0.0;
                for column in (0..columns).filter(|column| tiles.contains(x0 + column, y0 + row)) {
                    let pixel = 3 * (first + column);
                    x[3 * column..3 * column + 3].copy_from_slice(&render[pixel..pixel + 3]);
                    let weight = weights.get(first + column).copied().unwrap_or(1.0);
                    for k in 3 * column..3 * column + 3 {
                        let r = x[k] - y[k];
                        sum += weight * r.abs();
                        v[k] = if r == 0.0 { 0.0 } else { factor * weight * r.signum() };
                        y[k] += (1.0 - weight.min(1.0)) * r;
                    }
                }
                sum
            })
            .collect();
        let mut loss = factor * row_sums.iter().sum::<f32>();
        if self.share > 0.0 {
            self.ssim.resize(columns, rows);
            loss +=
                self.share * self.ssim.loss(&self.x, &self.y, norm, self.share, &mut self.v, None);
        }
        for (row, v) in self.v.chunks_exact(3 * columns).enumerate() {
            let first = (y0 + row) * width + x0;
            for column in (0..columns).filter(|column| tiles.contains(x0 + column, y0 + row)) {
                let pixel = 3 * (first + column);
                v_render[pixel..pixel + 3].copy_from_slice(&v[3 * column..3 * column + 3]);
            }
        }
        loss
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(seed: u32) -> Vec<f32> {
        (0..20 * 16 * 3_u32)
            .map(|k| {
                let hash = (k ^ seed).wrapping_mul(2_654_435_761).rotate_left(13) % 1000;
                0.2 + 0.6 * hash as f32 / 1000.0
            })
            .collect()
    }

    /// Against central differences, with and without weights; L1's kinks are avoided by the step.
    #[test]
    fn gradient_matches_differences() {
        let (x, y) = (image(1), image(2));
        let tiles = TileSet::around(&[true; 320], 20, 16);
        let weights: Vec<f32> = (0..320).map(|p| if p % 20 < 8 { 0.0 } else { 1.0 }).collect();
        for weights in [&[][..], &weights[..]] {
            let target = Target { width: 20, height: 16, rgb: &y, weights, tiles: &tiles };
            let mut loss = PictureLoss::new(0.2);
            let mut v = Vec::new();
            loss.evaluate(&x, &target, &mut v);
            let mut unused = Vec::new();
            for k in (0..x.len()).step_by(37) {
                // the blended target changes with the render, but counts as constant
                if !weights.is_empty() && k / 3 % 20 < 14 {
                    continue;
                }
                let mut at = |step: f32| {
                    let mut moved = x.clone();
                    moved[k] += step;
                    f64::from(loss.evaluate(&moved, &target, &mut unused))
                };
                let slope = (at(4e-3) - at(-4e-3)) / 8e-3;
                let error = (slope - f64::from(v[k])).abs();
                assert!(error < 4e-5, "value {k}: {slope} {}", v[k]);
            }
            if !weights.is_empty() {
                // A pixel with weight has a slope of 1e-3; this is rounding of SSIM's variances.
                let slope = v[3 * 2].abs();
                assert!(slope < 1e-6, "no influence far inside the weightless part: {slope}");
            }
        }
    }
}
