//! Preservation of the background, and strength of an edit.

use gs_core::Image;

/// Background pixels are not measured below this share of the image.
const MIN_BACKGROUND: f64 = 0.01;
/// Mean squared errors below this are reported as 100 dB.
const FLOOR: f64 = 1e-10;

/// An image before and after an edit, and the mask of edited pixels.
#[derive(Debug, Clone, Copy)]
pub struct EditedImage<'a> {
    /// Image before the edit, `[H,W,C]`.
    pub before: &'a Image,
    /// Image after the edit, `[H,W,C]`.
    pub after: &'a Image,
    /// Edited pixels, `[H,W]`.
    pub mask: &'a [bool],
}

impl EditedImage<'_> {
    /// Calls `sink` with the two values of every pixel whose mask equals `inside`; returns their
    /// number.
    fn each(&self, inside: bool, mut sink: impl FnMut(&[f32], &[f32])) -> usize {
        let channels = self.before.channels.max(1);
        let pixels = self.before.data.chunks_exact(channels);
        let mut count = 0;
        for ((a, b), _) in pixels
            .zip(self.after.data.chunks_exact(channels))
            .zip(self.mask)
            .filter(|(_, masked)| **masked == inside)
        {
            sink(a, b);
            count += 1;
        }
        count
    }

    fn is_enough(&self, background: usize) -> bool {
        background as f64 >= MIN_BACKGROUND * self.mask.len() as f64 && background > 0
    }

    /// PSNR of unedited pixels, dB, data range 1, at most 100; higher is better. `None` if they are
    /// less than 1 % of the image.
    pub fn background_psnr(&self) -> Option<f64> {
        let mut sum = 0.0;
        let count = self.each(false, |a, b| {
            sum += a.iter().zip(b).map(|(x, y)| f64::from(x - y).powi(2)).sum::<f64>();
        });
        let values = (count * self.before.channels) as f64;
        self.is_enough(count).then(|| -10.0 * (sum / values).max(FLOOR).log10())
    }

    /// Mean of `map`, the SSIM of the window around each pixel (`[H,W,C]`), over unedited pixels;
    /// higher is better. `None` if they are less than 1 % of the image.
    pub fn background_ssim(&self, map: &[f32]) -> Option<f64> {
        let channels = self.before.channels.max(1);
        let (mut sum, mut count) = (0.0, 0);
        for (pixel, _) in map.chunks_exact(channels).zip(self.mask).filter(|(_, masked)| !**masked)
        {
            sum += pixel.iter().map(|&value| f64::from(value)).sum::<f64>();
            count += 1;
        }
        self.is_enough(count).then(|| sum / (count * channels) as f64)
    }

    /// Share of unedited pixels in which a channel differs by more than `threshold` (0 to 1); lower
    /// is better. `None` if they are less than 1 % of the image.
    pub fn background_changed(&self, threshold: f32) -> Option<f64> {
        let mut changed = 0_usize;
        let count = self.each(false, |a, b| {
            changed += usize::from(a.iter().zip(b).any(|(x, y)| (x - y).abs() > threshold));
        });
        self.is_enough(count).then(|| changed as f64 / count as f64)
    }

    /// Mean `|after − before|` over edited pixels and channels, 0 to 1: the strength of the edit.
    /// `None` without edited pixels.
    pub fn strength(&self) -> Option<f64> {
        let mut sum = 0.0;
        let count = self.each(true, |a, b| {
            sum += a.iter().zip(b).map(|(x, y)| f64::from((x - y).abs())).sum::<f64>();
        });
        (count > 0).then(|| sum / (count * self.before.channels) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_inside_and_outside_the_mask_are_separated() {
        let before = Image::from_data(4, 1, 1, vec![0.5; 4]).unwrap();
        let after = Image::from_data(4, 1, 1, vec![0.5, 0.6, 0.9, 0.5]).unwrap();
        let mask = [false, false, true, true];
        let edited = EditedImage { before: &before, after: &after, mask: &mask };
        let psnr = edited.background_psnr().unwrap();
        assert!((psnr + 10.0 * (0.01_f64 / 2.0).log10()).abs() < 1e-4, "one of two is off: {psnr}");
        assert_eq!(edited.background_changed(2.0 / 255.0), Some(0.5), "one of two");
        assert_eq!(edited.background_changed(0.2), Some(0.0), "not by that much");
        assert!((edited.strength().unwrap() - 0.2).abs() < 1e-6, "0.4 and 0");
        let all = EditedImage { mask: &[true; 4], ..edited };
        assert_eq!(all.background_psnr(), None, "no background");
        let none = EditedImage { mask: &[false; 4], ..edited };
        assert_eq!(none.strength(), None, "nothing touched");
    }
}
