//! Structural similarity at multiple scales.

use crate::{Ssim, SsimBorder, halved};
use gs_core::Image;

/// Exponents of the five scales, finest first (Wang, Simoncelli and Bovik 2003).
pub const MS_SSIM_WEIGHTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];
/// Smallest side of an image, pixels, for which a window fits at the coarsest scale.
pub const MS_SSIM_MIN_SIDE: usize = 176;

/// `Π_j cs_j^{w_j}` over five scales, per channel, then the mean over channels. `cs_j` is the mean
/// of SSIM's contrast–structure term at scale j (at the coarsest scale, of the whole SSIM),
/// negative means counted as 0, over windows inside the image. Scales differ by 2×2 means (an odd
/// last row or column is dropped). Data range 1, at most 1; higher is better. `None` if the images
/// differ in shape or have a side below [`MS_SSIM_MIN_SIDE`].
pub fn ms_ssim(image: &Image, reference: &Image) -> Option<f64> {
    let shape = |image: &Image| (image.width, image.height, image.channels);
    let (width, height, channels) = shape(image);
    if shape(reference) != shape(image) || width.min(height) < MS_SSIM_MIN_SIDE {
        return None;
    }
    let values = (0..channels).map(|c| {
        let plane = |image: &Image| Image {
            width,
            height,
            channels: 1,
            data: image.data.iter().skip(c).step_by(channels).copied().collect(),
        };
        of_plane(plane(image), plane(reference))
    });
    Some(values.sum::<f64>() / channels.max(1) as f64)
}

fn of_plane(mut x: Image, mut y: Image) -> f64 {
    let mut value = 1.0;
    for (scale, weight) in MS_SSIM_WEIGHTS.into_iter().enumerate() {
        let mut ssim = Ssim::<f32>::new(x.width, x.height, 1);
        let mean = if scale + 1 == MS_SSIM_WEIGHTS.len() {
            ssim.value(&x.data, &y.data, SsimBorder::Valid)
        } else {
            ssim.contrast_structure(&x.data, &y.data, SsimBorder::Valid)
        };
        value *= f64::from(mean).max(0.0).powf(weight);
        (x, y) = (halved(&x), halved(&y));
    }
    value
}
