//! Pillow's bicubic filter for 8-bit images: antialiased, in fixed point, columns first, with the
//! intermediate image rounded to 8 bits.

use crate::rgb8::Rgb8;

/// Parameter of the filter.
const A: f64 = -0.5;
/// Radius of the filter, source pixels at a scale of 1.
const SUPPORT: f64 = 2.0;
/// Fractional bits of the weights.
const BITS: u32 = 22;

/// First source pixel and weights of a new pixel.
struct Taps {
    first: usize,
    weights: Vec<i64>,
}

fn filter(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 {
        ((A + 2.0) * x - (A + 3.0)) * x * x + 1.0
    } else if x < SUPPORT {
        (((x - 5.0) * x + 8.0) * x - 4.0) * A
    } else {
        0.0
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "positions lie within the image, weights within fixed point"
)]
fn taps(from: usize, to: usize) -> Vec<Taps> {
    let scale = from as f64 / to as f64;
    let widened = scale.max(1.0);
    let support = SUPPORT * widened;
    (0..to)
        .map(|at| {
            let center = (at as f64 + 0.5) * scale;
            let first = (center - support + 0.5).max(0.0) as usize;
            let end = ((center + support + 0.5) as usize).min(from);
            let weights: Vec<f64> = (first..end)
                .map(|source| filter((source as f64 - center + 0.5) / widened))
                .collect();
            let total: f64 = weights.iter().sum();
            let fixed = |weight: f64| {
                let scaled = weight / total * f64::from(1_u32 << BITS);
                // Rounded away from zero at halves, by truncation.
                (scaled + 0.5_f64.copysign(scaled)) as i64
            };
            Taps { first, weights: weights.into_iter().map(fixed).collect() }
        })
        .collect()
}

/// Sum of weighted samples, rounded and clamped to 8 bits.
fn sample(taps: &Taps, value: impl Fn(usize) -> u8) -> u8 {
    let mut sum = 1_i64 << (BITS - 1);
    for (step, weight) in taps.weights.iter().enumerate() {
        sum += weight * i64::from(value(taps.first + step));
    }
    u8::try_from((sum >> BITS).clamp(0, 255)).unwrap_or_default()
}

/// The image with `width` × `height` pixels.
pub(crate) fn resize(image: Rgb8<'_>, width: usize, height: usize) -> Vec<u8> {
    let columns = taps(image.width, width);
    let mut wide = Vec::with_capacity(3 * width * image.height);
    for line in image.pixels.chunks_exact(3 * image.width) {
        for taps in &columns {
            for channel in 0..3 {
                wide.push(sample(taps, |x| line[3 * x + channel]));
            }
        }
    }
    let mut out = Vec::with_capacity(3 * width * height);
    for taps in &taps(image.height, height) {
        for at in 0..3 * width {
            out.push(sample(taps, |y| wide[3 * width * y + at]));
        }
    }
    out
}
