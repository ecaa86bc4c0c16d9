//! Peak signal-to-noise ratio.

use gs_core::Image;

/// Mean squared errors below this are reported as 100 dB.
const FLOOR: f64 = 1e-10;

/// `−10 log₁₀ MSE`, dB, data range 1, over all pixels and channels of 8-bit-rounded
/// images (the value computed from saved PNGs); at most 100 dB. Higher is better.
/// `None` if the images differ in shape or are empty.
pub fn psnr(image: &Image, reference: &Image) -> Option<f64> {
    let shape = |image: &Image| (image.width, image.height, image.channels);
    if shape(image) != shape(reference) || image.data.is_empty() {
        return None;
    }
    let (a, b) = (image.to_bytes(), reference.to_bytes());
    let sum: f64 =
        a.iter().zip(&b).map(|(&x, &y)| ((f64::from(x) - f64::from(y)) / 255.0).powi(2)).sum();
    Some(-10.0 * (sum / a.len() as f64).max(FLOOR).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: f32) -> Image {
        Image::from_data(2, 2, 3, vec![value; 12]).unwrap()
    }

    #[test]
    fn known_values() {
        assert_eq!(psnr(&flat(0.5), &flat(0.5)), Some(100.0), "equal images are capped");
        let off = psnr(&flat(1.0), &flat(0.0)).unwrap();
        assert!(off.abs() < 1e-9, "black against white is 0 dB: {off}");
        assert_eq!(psnr(&flat(0.5), &Image::zeros(2, 2, 1)), None, "other shape");
    }
}
