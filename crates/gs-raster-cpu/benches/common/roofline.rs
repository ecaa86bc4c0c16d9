//! The roofline: pixel–splat samples per second that the arithmetic alone allows on one core, with
//! all data in registers and the first-level cache. Exponent (two FMA), exponential, cap,
//! transmittance, and one FMA per channel; no lists, tests, masks or sums in memory.

use pulp::{Arch, Simd, WithSimd};

/// Channels of the measured passes: RGB and depth.
const CHANNELS: usize = 4;
const PIXELS: usize = 256;
/// Number of splats after which the transmittance is reset to 1, so that it does not become
/// denormal, as in any rasteriser.
const RESET: usize = 64;

/// Transmittance of a tile, aligned as in the rasteriser.
#[repr(C, align(64))]
struct Tile([f32; PIXELS]);

struct Arithmetic<'a> {
    tile: &'a mut Tile,
    columns: &'a Tile,
    splats: usize,
}

impl WithSimd for Arithmetic<'_> {
    type Output = f32;

    #[expect(
        clippy::inline_always,
        reason = "inlined into the function of the wider instruction set"
    )]
    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) -> f32 {
        let splat = |x: f32| s.splat_f32s(x);
        let (columns, _) = S::as_simd_f32s(&self.columns.0);
        let (transmittance, _) = S::as_mut_simd_f32s(&mut self.tile.0);
        let coefficients =
            [1.0, std::f32::consts::LN_2, 0.240_22, 0.055_51, 0.009_67, 0.001_33].map(splat);
        let mut sums = [splat(0.0); CHANNELS];
        for i in 0..self.splats {
            if i.is_multiple_of(RESET) {
                transmittance.fill(splat(1.0));
            }
            let shade = i as f32 * 1e-6;
            let (a, b, c) = (splat(-0.01 - shade), splat(0.002), splat(-3.0 - shade));
            let channels = [0.1, 0.2, 0.3, 0.4].map(|x| splat(x + shade));
            for (t, &dx) in transmittance.iter_mut().zip(columns) {
                let exponent = s.mul_add_e_f32s(dx, s.mul_add_e_f32s(a, dx, b), c);
                let shifted = s.add_f32s(exponent, splat(12_582_912.0));
                let f = s.sub_f32s(exponent, s.sub_f32s(shifted, splat(12_582_912.0)));
                let pair = |k: usize| s.mul_add_e_f32s(f, coefficients[k + 1], coefficients[k]);
                let f2 = s.mul_f32s(f, f);
                let p = s.mul_add_e_f32s(s.mul_add_e_f32s(pair(4), f2, pair(2)), f2, pair(0));
                let n = s.wrapping_dyn_shl_u32s(s.transmute_u32s_f32s(shifted), s.splat_u32s(23));
                let e = s.transmute_f32s_u32s(s.add_u32s(s.transmute_u32s_f32s(p), n));
                let alpha = s.min_f32s(e, splat(0.99));
                let weight = s.mul_f32s(alpha, *t);
                *t = s.negate_mul_add_e_f32s(alpha, *t, *t);
                for (sum, channel) in sums.iter_mut().zip(channels) {
                    *sum = s.mul_add_e_f32s(channel, weight, *sum);
                }
            }
        }
        sums.iter().map(|&sum| s.reduce_sum_f32s(sum)).sum()
    }
}

/// Samples that one call of [`run`] evaluates.
pub(crate) const SAMPLES: u64 = 4096 * PIXELS as u64;

/// Evaluates [`SAMPLES`] samples; returning the value keeps the optimiser from removing them.
pub(crate) fn run() -> f32 {
    let mut columns = Tile([0.0; PIXELS]);
    for (i, column) in columns.0.iter_mut().enumerate() {
        *column = 7.3 - (i % 16) as f32;
    }
    let mut tile = Tile([1.0; PIXELS]);
    Arch::new().dispatch(Arithmetic { tile: &mut tile, columns: &columns, splats: 4096 })
}
