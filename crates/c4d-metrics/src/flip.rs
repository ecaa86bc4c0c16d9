//! ꟻLIP: the perceived difference between two images that alternate on a screen.

use gs_core::Image;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Pixels per degree of a 0.7 m wide screen of 3840 pixels at a distance of 0.7 m: the default of
/// ꟻLIP.
pub const FLIP_PIXELS_PER_DEGREE: f64 = 0.7 * 3840.0 / 0.7 * PI / 180.0;

/// Contrast sensitivity of the achromatic, red–green and blue–yellow channels, as sums of Gaussians
/// `a·√(π/b)·exp(−π²x²/b)`, x in degrees.
const SENSITIVITY: [[[f64; 2]; 2]; 3] =
    [[[1.0, 0.0047], [0.0, 1e-5]], [[1.0, 0.0053], [0.0, 1e-5]], [[34.1, 0.04], [13.5, 0.025]]];
/// Exponent of the colour difference.
const COLOR_EXPONENT: f32 = 0.7;
/// Colour differences below this share of the largest are mapped to [`COLOR_KNEE`] of the range.
const COLOR_SHARE: f32 = 0.4;
const COLOR_KNEE: f32 = 0.95;
/// Width of edges and points, degrees.
const FEATURE_DEGREES: f64 = 0.082;
/// Exponent of the feature difference.
const FEATURE_EXPONENT: f32 = 0.5;
const TO_XYZ: [[f32; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];
const FROM_XYZ: [[f32; 3]; 3] = [
    [3.241_003_3, -1.537_399, -0.498_615_86],
    [-0.969_224_3, 1.875_930_1, 0.041_554_224],
    [0.055_639_423, -0.204_011_2, 1.057_148_9],
];
/// Reference white of `TO_XYZ`.
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];

/// Error of `image` against `reference` per pixel, `[H,W,1]`, 0 to 1, by LDR-ꟻLIP (Andersson et al.
/// 2020). Both are sRGB in [0, 1] and are blurred by the eye's contrast sensitivity at
/// `pixels_per_degree`. `ΔE_c` is the HyAB distance of the Hunt-adjusted L*a*b* colours to the
/// power 0.7, rescaled so that 0.4 of the largest maps to 0.95; `ΔE_f` is the root of the larger
/// difference of edges or points of the luminance; the result is `ΔE_c^(1 − ΔE_f)`. Lower is
/// better. `None` if the images are empty, differ in shape or do not have three channels.
pub fn flip_map(image: &Image, reference: &Image, pixels_per_degree: f64) -> Option<Image> {
    let shape = |image: &Image| (image.width, image.height, image.channels);
    if shape(image) != shape(reference) || image.channels != 3 || image.data.is_empty() {
        return None;
    }
    let filters = Filters::new(pixels_per_degree);
    let [a, b] = [image, reference].map(|image| Seen::of(image, &filters));
    let largest = hyab(hunted([0.0, 1.0, 0.0]), hunted([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    let knee = COLOR_SHARE * largest;
    let mut map = Image::zeros(image.width, image.height, 1);
    map.data.par_chunks_mut(image.width).enumerate().for_each(|(y, row)| {
        for (x, out) in row.iter_mut().enumerate() {
            let i = y * image.width + x;
            let color = hyab(a.colors[i], b.colors[i]).powf(COLOR_EXPONENT);
            let color = if color < knee {
                COLOR_KNEE / knee * color
            } else {
                COLOR_KNEE + (color - knee) / (largest - knee) * (1.0 - COLOR_KNEE)
            };
            let features = (a.edges[i] - b.edges[i]).abs().max((a.points[i] - b.points[i]).abs());
            let features = (features * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
            *out = color.powf(1.0 - features).clamp(0.0, 1.0);
        }
    });
    Some(map)
}

/// Mean of [`flip_map`] at [`FLIP_PIXELS_PER_DEGREE`].
pub fn flip(image: &Image, reference: &Image) -> Option<f64> {
    let map = flip_map(image, reference, FLIP_PIXELS_PER_DEGREE)?;
    Some(map.data.iter().map(|&error| f64::from(error)).sum::<f64>() / map.data.len() as f64)
}

/// Filter taps, symmetric or antisymmetric about their centre.
struct Filters {
    /// Two Gaussians of the sensitivity per channel: weight and taps of each.
    sensitivity: [[(f32, Vec<f32>); 2]; 3],
    /// Gaussian, edge and point detector.
    features: [Vec<f32>; 3],
}

impl Filters {
    fn new(pixels_per_degree: f64) -> Self {
        let widest = SENSITIVITY.iter().flatten().map(|[_, b]| *b).fold(0.0, f64::max);
        let radius = radius(3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree);
        let sensitivity = SENSITIVITY.map(|gaussians| {
            let taps = gaussians.map(|[a, b]| {
                let taps: Vec<f64> = span(radius)
                    .map(|x| (-(PI * x / pixels_per_degree).powi(2) / b).exp())
                    .collect();
                // for a separable Gaussian, the sum over the square is the square of the sum
                let sum: f64 = taps.iter().sum();
                (
                    a * (PI / b).sqrt() * sum * sum,
                    taps.iter().map(|tap| single(tap / sum)).collect(),
                )
            });
            let total: f64 = taps.iter().map(|(weight, _)| weight).sum();
            taps.map(|(weight, taps): (f64, Vec<f32>)| (single(weight / total), taps))
        });
        let deviation = 0.5 * FEATURE_DEGREES * pixels_per_degree;
        let radius = self::radius(3.0 * deviation);
        let bell = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        let gaussian: Vec<f64> = span(radius).map(bell).collect();
        let sum: f64 = gaussian.iter().sum();
        let features = [
            gaussian.iter().map(|tap| single(tap / sum)).collect(),
            balanced(span(radius).map(|x| -x * bell(x)).collect()),
            balanced(
                span(radius).map(|x| (x * x / (deviation * deviation) - 1.0) * bell(x)).collect(),
            ),
        ];
        Self { sensitivity, features }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "taps are single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a small positive number of pixels"
)]
fn radius(pixels: f64) -> usize {
    pixels.ceil().max(0.0) as usize
}

/// Integers from −radius to radius.
fn span(radius: usize) -> impl Iterator<Item = f64> {
    (0..=2 * radius).map(move |k| k as f64 - radius as f64)
}

/// Positive taps scaled to sum to 1, negative ones to −1.
fn balanced(taps: Vec<f64>) -> Vec<f32> {
    let positive: f64 = taps.iter().filter(|tap| **tap > 0.0).sum();
    let negative: f64 = -taps.iter().filter(|tap| **tap < 0.0).sum::<f64>();
    taps.into_iter()
        .map(|tap| single(if tap > 0.0 { tap / positive } else { tap / negative }))
        .collect()
}

/// An image prepared for comparison.
struct Seen {
    /// Hunt-adjusted L*a*b* of the blurred image.
    colors: Vec<[f32; 3]>,
    /// Strength of edges and of points of the luminance.
    edges: Vec<f32>,
    points: Vec<f32>,
}

impl Seen {
    fn of(image: &Image, filters: &Filters) -> Self {
        let size = (image.width, image.height);
        let opponent: Vec<[f32; 3]> = image
            .data
            .par_chunks_exact(3)
            .map(|rgb| to_opponent([0, 1, 2].map(|c| linear(rgb[c].clamp(0.0, 1.0)))))
            .collect();
        let plane = |c: usize| opponent.iter().map(|pixel| pixel[c]).collect::<Vec<f32>>();
        let [y, cx, cz] = [0, 1, 2].map(|c| {
            let plane = plane(c);
            let mut sum = vec![0.0; plane.len()];
            for (weight, taps) in filters.sensitivity[c].iter().filter(|(weight, _)| *weight > 0.0)
            {
                for (sum, value) in sum.iter_mut().zip(filtered(&plane, size, taps, taps)) {
                    *sum += weight * value;
                }
            }
            sum
        });
        let colors = (0..y.len())
            .into_par_iter()
            .map(|i| hunted(from_opponent([y[i], cx[i], cz[i]]).map(|value| value.clamp(0.0, 1.0))))
            .collect();
        let luminance: Vec<f32> = opponent.iter().map(|pixel| (pixel[0] + 16.0) / 116.0).collect();
        let [gaussian, edge, point] = &filters.features;
        let strength = |taps: &[f32]| -> Vec<f32> {
            let across = filtered(&luminance, size, taps, gaussian);
            let down = filtered(&luminance, size, gaussian, taps);
            across.iter().zip(&down).map(|(a, b)| a.hypot(*b)).collect()
        };
        Self { colors, edges: strength(edge), points: strength(point) }
    }
}

/// `plane` filtered with `across` along rows and `down` along columns; pixels beyond the border
/// have the value of the nearest border pixel.
fn filtered(
    plane: &[f32],
    (width, height): (usize, usize),
    across: &[f32],
    down: &[f32],
) -> Vec<f32> {
    let mut rows = vec![0.0; plane.len()];
    let half = across.len() / 2;
    rows.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, row)| {
        let mut padded = Vec::with_capacity(width + 2 * half);
        padded.extend(std::iter::repeat_n(row[0], half));
        padded.extend_from_slice(row);
        padded.extend(std::iter::repeat_n(row[width - 1], half));
        for (k, &tap) in across.iter().enumerate() {
            for (out, &value) in out.iter_mut().zip(&padded[k..]) {
                *out += tap * value;
            }
        }
    });
    let mut out = vec![0.0; plane.len()];
    let half = down.len() / 2;
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (k, &tap) in down.iter().enumerate() {
            let from = (y + k).saturating_sub(half).min(height - 1);
            for (out, &value) in out.iter_mut().zip(&rows[from * width..][..width]) {
                *out += tap * value;
            }
        }
    });
    out
}

fn linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

fn times(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|r| matrix[r][0] * v[0] + matrix[r][1] * v[1] + matrix[r][2] * v[2])
}

/// Linear RGB to YCxCz.
fn to_opponent(rgb: [f32; 3]) -> [f32; 3] {
    let xyz = times(&TO_XYZ, rgb);
    let [x, y, z] = [0, 1, 2].map(|c| xyz[c] / WHITE[c]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_opponent([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (y + 16.0) / 116.0;
    let xyz = [y + cx / 500.0, y, y - cz / 200.0];
    times(&FROM_XYZ, [0, 1, 2].map(|c| xyz[c] * WHITE[c]))
}

/// Linear RGB to L*a*b* with Hunt's effect: dark colours look less saturated.
fn hunted(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let xyz = times(&TO_XYZ, rgb);
    let [x, y, z] = [0, 1, 2].map(|c| {
        let t = xyz[c] / WHITE[c];
        if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

/// HyAB distance: city-block in lightness, Euclidean in chroma.
fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}
