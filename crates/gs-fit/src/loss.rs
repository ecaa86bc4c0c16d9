//! [`PictureLoss`]: L1 and D-SSIM of a render against a picture.

use c4d_metrics::{SSIM_RADIUS, Ssim};
use rayon::prelude::*;

/// Rectangle of pixels: columns `x0..x1`, rows `y0..y1`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rect {
    /// First column.
    pub x0: usize,
    /// First row.
    pub y0: usize,
    /// Column after the last.
    pub x1: usize,
    /// Row after the last.
    pub y1: usize,
}

impl Rect {
    /// The smallest rectangle that contains both; empty ones are ignored.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        if self.x1 <= self.x0 || self.y1 <= self.y0 {
            return other;
        }
        if other.x1 <= other.x0 || other.y1 <= other.y0 {
            return self;
        }
        Self {
            x0: self.x0.min(other.x0),
            y0: self.y0.min(other.y0),
            x1: self.x1.max(other.x1),
            y1: self.y1.max(other.y1),
        }
    }

    /// The rectangle and `margin` pixels around it, within an image.
    #[must_use]
    pub fn grown(self, margin: usize, width: usize, height: usize) -> Self {
        if self.x1 <= self.x0 || self.y1 <= self.y0 {
            return Self::default();
        }
        Self {
            x0: self.x0.saturating_sub(margin),
            y0: self.y0.saturating_sub(margin),
            x1: (self.x1 + margin).min(width),
            y1: (self.y1 + margin).min(height),
        }
    }

    /// Whether the pixel is inside the rectangle.
    pub fn contains(self, x: usize, y: usize) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
    }

    /// Whether the rectangles have a pixel in common.
    pub fn overlaps(self, other: Self) -> bool {
        self.x0.max(other.x0) < self.x1.min(other.x1)
            && self.y0.max(other.y0) < self.y1.min(other.y1)
    }

    /// The smallest rectangle that contains the set pixels of a mask.
    pub fn around(mask: &[bool], width: usize) -> Self {
        let mut rect = Self::default();
        for (y, row) in mask.chunks(width.max(1)).enumerate() {
            if let (Some(left), Some(right)) =
                (row.iter().position(|&on| on), row.iter().rposition(|&on| on))
            {
                rect = rect.union(Self { x0: left, y0: y, x1: right + 1, y1: y + 1 });
            }
        }
        rect
    }
}

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
    /// The part of the image that is compared; all other pixels count as equal.
    pub rect: Rect,
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
        let &Target { width, height, rgb, weights, rect } = target;
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
        let rect = rect.grown(SSIM_RADIUS, width, height);
        let (columns, rows) = (rect.x1 - rect.x0, rect.y1 - rect.y0);
        if columns == 0 || rows == 0 {
            return 0.0;
        }
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
                let first = (rect.y0 + row) * width + rect.x0;
                x.copy_from_slice(&render[3 * first..3 * (first + columns)]);
                y.copy_from_slice(&rgb[3 * first..3 * (first + columns)]);
                let mut sum = 0.0;
                for column in 0..columns {
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
            let first = 3 * ((rect.y0 + row) * width + rect.x0);
            v_render[first..first + 3 * columns].copy_from_slice(v);
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
        let weights: Vec<f32> = (0..320).map(|p| if p % 20 < 8 { 0.0 } else { 1.0 }).collect();
        for weights in [&[][..], &weights[..]] {
            let target = Target {
                width: 20,
                height: 16,
                rgb: &y,
                weights,
                rect: Rect { x0: 0, y0: 0, x1: 20, y1: 16 },
            };
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
