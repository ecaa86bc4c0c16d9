//! Images of half the size, and the adjoint of the reduction.

use gs_core::Image;

/// The four pixels of an image, `large` pixels wide, under pixel `p` of the half-size one, `small`
/// pixels wide; indices row by row.
pub fn pixels_under(p: usize, small: usize, large: usize) -> [usize; 4] {
    let first = 2 * (p / small) * large + 2 * (p % small);
    [first, first + 1, first + large, first + large + 1]
}

/// Means of 2×2 pixels, `[⌊H/2⌋,⌊W/2⌋,C]`; an odd last row or column is dropped.
pub fn halved(image: &Image) -> Image {
    let (width, height, channels) = (image.width / 2, image.height / 2, image.channels);
    let mut small = Image::zeros(width, height, channels);
    for p in 0..width * height {
        let pixels = pixels_under(p, width, image.width);
        for c in 0..channels {
            let sum: f32 = pixels.iter().map(|&q| image.data[q * channels + c]).sum();
            small.data[p * channels + c] = 0.25 * sum;
        }
    }
    small
}

/// Adds the adjoint of [`halved`] to `v_large`: the gradient with respect to the larger image, given
/// that with respect to the smaller one. Both have the same number of channels.
pub fn add_halved_adjoint(v_small: &Image, v_large: &mut Image) {
    let channels = v_small.channels;
    for p in 0..v_small.width * v_small.height {
        for q in pixels_under(p, v_small.width, v_large.width) {
            for c in 0..channels {
                v_large.data[q * channels + c] += 0.25 * v_small.data[p * channels + c];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::SplitMix64;

    fn noise(width: usize, height: usize, seed: u64) -> Image {
        let mut random = SplitMix64::new(seed);
        let mut image = Image::zeros(width, height, 3);
        image.data.fill_with(|| (random.next_u64() >> 40) as f32 / (1_u32 << 24) as f32);
        image
    }

    #[test]
    fn the_adjoint_agrees_with_the_reduction() {
        let (large, v_small) = (noise(9, 7, 1), noise(4, 3, 2));
        let mut v_large = Image::zeros(9, 7, 3);
        add_halved_adjoint(&v_small, &mut v_large);
        let dot =
            |a: &Image, b: &Image| a.data.iter().zip(&b.data).map(|(a, b)| a * b).sum::<f32>();
        let (left, right) = (dot(&halved(&large), &v_small), dot(&large, &v_large));
        assert!((left - right).abs() < 1e-5, "{left} {right}");
        assert!(v_large.pixel(8, 0) == [0.0; 3], "an odd last column has no influence");
    }
}
