//! Changes from frame to frame.

use crate::FlowField;
use gs_core::Image;

/// Mean absolute difference of two images `[H,W,C]` over pixels and channels, in 8-bit levels, 0 to
/// 255; lower is better. Values are clamped to 0 to 1 and rounded to 8 bits first. `None` if shapes
/// differ or there are no pixels. See also [`temporal_flickering`].
pub fn mean_absolute_difference(a: &Image, b: &Image) -> Option<f64> {
    let shape = |image: &Image| (image.width, image.height, image.channels);
    if shape(a) != shape(b) || a.data.is_empty() {
        return None;
    }
    let sum: u64 =
        a.to_bytes().iter().zip(b.to_bytes()).map(|(&x, y)| u64::from(x.abs_diff(y))).sum();
    Some(sum as f64 / a.data.len() as f64)
}

/// VBench's temporal flickering: `(255 − d) / 255`, where `d` (`mean_difference`) is the mean of
/// [`mean_absolute_difference`] over pairs of successive frames, 8-bit levels. From 0 to 1, 1 for a
/// constant video; higher is better. Motion lowers it too, so compare it with the value of the
/// scene before the edit.
pub fn temporal_flickering(mean_difference: f64) -> f64 {
    (255.0 - mean_difference) / 255.0
}

/// Flicker of static pixels: standard deviation over time of pixels that show the same static point
/// of the scene at all times. Sums are integers, hence exact, for up to 66 000 frames.
#[derive(Debug, Clone, Default)]
pub struct StaticFlicker {
    frames: u64,
    /// Sums of values and of their squares, `[H,W,C]`.
    sums: Vec<[u32; 2]>,
    /// Pixels that have been static so far, `[H,W]`.
    still: Vec<bool>,
}

impl StaticFlicker {
    /// Motion at which a pixel counts as moving, pixels per frame.
    pub const STILL: f32 = 0.25;

    /// Adds a frame `[H,W,C]`, values 0 to 1, rounded to 8 bits. All frames must have the same
    /// shape.
    pub fn add(&mut self, frame: &Image) {
        self.sums.resize(frame.data.len(), [0; 2]);
        self.still.resize(frame.width * frame.height, true);
        for (sums, value) in self.sums.iter_mut().zip(frame.to_bytes()) {
            let value = u32::from(value);
            sums[0] = sums[0].saturating_add(value);
            sums[1] = sums[1].saturating_add(value * value);
        }
        self.frames += 1;
    }

    /// Excludes pixels that move by [`StaticFlicker::STILL`] or more, or whose motion is unknown.
    /// `flow` is the motion between two frames, pixels, of the frames' size.
    pub fn exclude_moving(&mut self, flow: &FlowField) {
        self.still.resize(flow.vectors().len(), true);
        for (still, v) in self.still.iter_mut().zip(flow.vectors()) {
            *still &= v[0].hypot(v[1]) < Self::STILL;
        }
    }

    /// Mean over static pixels and channels of the standard deviation over time, 8-bit levels;
    /// lower is better. `None` without such pixels, or with fewer than two frames.
    pub fn value(&self) -> Option<f64> {
        let channels = self.sums.len() / self.still.len().max(1);
        if self.frames < 2 || channels == 0 {
            return None;
        }
        let count = self.frames as f64;
        let (mut sum, mut values) = (0.0, 0_usize);
        for (pixel, _) in
            self.sums.chunks_exact(channels).zip(&self.still).filter(|(_, still)| **still)
        {
            for &[values_sum, squares] in pixel {
                let (values_sum, squares) = (u64::from(values_sum), u64::from(squares));
                let spread = (self.frames * squares).saturating_sub(values_sum * values_sum);
                sum += (spread as f64).sqrt() / count;
                values += 1;
            }
        }
        (values > 0).then(|| sum / values as f64)
    }
}
