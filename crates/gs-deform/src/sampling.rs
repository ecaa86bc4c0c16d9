//! Features of a panel of Gaussians: products over the planes, fused with their sampling.
//!
//! At a fixed time the planes (x,t), (y,t), (z,t) collapse to lines, once per call. The product of
//! the planes (x,y), (x,z), (y,z) is constant over time, so scenes may cache it per Gaussian.

use crate::hexplane::{HexPlane, Tap};

/// The time planes of every level at one time: `[L][3 axes]`, each `[resolution, C]`.
#[derive(Debug)]
pub(crate) struct TimeLines {
    levels: Vec<[Vec<f32>; 3]>,
}

/// Planes with a time axis, by spatial axis.
const TIME_PLANES: [usize; 3] = [2, 4, 5];
/// Purely spatial planes.
const SPATIAL_PLANES: [(usize, usize, usize); 3] = [(0, 0, 1), (1, 0, 2), (3, 1, 2)];

impl TimeLines {
    pub(crate) fn new(planes: &HexPlane, t: f32) -> Self {
        let levels = planes.levels.iter().map(|level| {
            TIME_PLANES.map(|p| {
                let plane = &level[p];
                let tap = Tap::new(t, plane.rows);
                let row = plane.columns * planes.channels;
                let (low, high) =
                    (&plane.texels[tap.low * row..][..row], &plane.texels[tap.high * row..][..row]);
                low.iter().zip(high).map(|(a, b)| a * tap.w_low + b * tap.w_high).collect()
            })
        });
        Self { levels: levels.collect() }
    }
}

/// Product of the three spatial planes per level: writes `[rows of coords, L·C]`.
#[inline(always)]
pub(crate) fn spatial_products(planes: &HexPlane, coords: &[[f32; 3]], out: &mut [f32]) {
    // The two published widths use loops of constant length.
    match planes.channels {
        16 => spatial_body(planes, 16, coords, out),
        32 => spatial_body(planes, 32, coords, out),
        channels => spatial_body(planes, channels, coords, out),
    }
}

#[inline(always)]
fn spatial_body(planes: &HexPlane, channels: usize, coords: &[[f32; 3]], out: &mut [f32]) {
    for (u, features) in coords.iter().zip(out.chunks_exact_mut(planes.num_features())) {
        for (level, product) in planes.levels.iter().zip(features.chunks_exact_mut(channels)) {
            for (order, (p, first, second)) in SPATIAL_PLANES.into_iter().enumerate() {
                let plane = &level[p];
                let i = Tap::new(u[first], plane.columns);
                let j = Tap::new(u[second], plane.rows);
                let texel = |row: usize, column: usize| {
                    &plane.texels[(row * plane.columns + column) * channels..][..channels]
                };
                let (a, b) = (texel(j.low, i.low), texel(j.low, i.high));
                let (c, d) = (texel(j.high, i.low), texel(j.high, i.high));
                let (wa, wb) = (i.w_low * j.w_low, i.w_high * j.w_low);
                let (wc, wd) = (i.w_low * j.w_high, i.w_high * j.w_high);
                let product = &mut product[..channels];
                for k in 0..channels {
                    let value = a[k] * wa + b[k] * wb + c[k] * wc + d[k] * wd;
                    product[k] = if order == 0 { value } else { product[k] * value };
                }
            }
        }
    }
}

/// Multiplies spatial products `[rows, L·C]` in place by the time lines.
#[inline(always)]
pub(crate) fn multiply_time(
    planes: &HexPlane,
    lines: &TimeLines,
    coords: &[[f32; 3]],
    features: &mut [f32],
) {
    match planes.channels {
        16 => time_body(planes, lines, 16, coords, features),
        32 => time_body(planes, lines, 32, coords, features),
        channels => time_body(planes, lines, channels, coords, features),
    }
}

#[inline(always)]
fn time_body(
    planes: &HexPlane,
    lines: &TimeLines,
    channels: usize,
    coords: &[[f32; 3]],
    features: &mut [f32],
) {
    for (u, row) in coords.iter().zip(features.chunks_exact_mut(planes.num_features())) {
        for (lines, product) in lines.levels.iter().zip(row.chunks_exact_mut(channels)) {
            let [x, y, z] = [0, 1, 2].map(|axis| {
                let line: &[f32] = &lines[axis];
                let tap = Tap::new(u[axis], line.len() / channels);
                let texel = |index: usize| &line[index * channels..][..channels];
                (texel(tap.low), texel(tap.high), tap.w_low, tap.w_high)
            });
            let product = &mut product[..channels];
            for k in 0..channels {
                let lerp = |(a, b, wa, wb): (&[f32], &[f32], f32, f32)| a[k] * wa + b[k] * wb;
                product[k] *= lerp(x) * lerp(y) * lerp(z);
            }
        }
    }
}
