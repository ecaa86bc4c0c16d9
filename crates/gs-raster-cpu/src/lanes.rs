//! [`Lane`]: vector registers of `f32` or `f64`, generic over the
//! instruction set that `pulp` selects at run time.

use gs_core::Real;
use pulp::{Arch, Simd};

/// A float type with vector registers for the kernels.
///
/// The methods are exactly the instructions that the kernels use. All of them inline into the
/// function that `pulp` compiles once per instruction set.
pub trait Lane: Real {
    /// A register.
    type Vector<S: Simd>: Copy;
    /// A register of lane masks.
    type Mask<S: Simd>: Copy;

    fn vsplat<S: Simd>(s: S, x: Self) -> Self::Vector<S>;
    fn vadd<S: Simd>(s: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    fn vsub<S: Simd>(s: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    fn vmul<S: Simd>(s: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    fn vdiv<S: Simd>(s: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    fn vmin<S: Simd>(s: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    fn vmax<S: Simd>(s: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// `a·b + c`, fused where the hardware fuses.
    fn vfma<S: Simd>(
        s: S,
        a: Self::Vector<S>,
        b: Self::Vector<S>,
        c: Self::Vector<S>,
    ) -> Self::Vector<S>;
    /// `c − a·b`, fused where the hardware fuses.
    fn vfnma<S: Simd>(
        s: S,
        a: Self::Vector<S>,
        b: Self::Vector<S>,
        c: Self::Vector<S>,
    ) -> Self::Vector<S>;
    fn vsqrt<S: Simd>(s: S, a: Self::Vector<S>) -> Self::Vector<S>;
    fn vneg<S: Simd>(s: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// `|a|`.
    fn vabs<S: Simd>(s: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// `a ≤ b`, false for NaN.
    fn vle<S: Simd>(s: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Mask<S>;
    /// `a < b`, false for NaN.
    fn vlt<S: Simd>(s: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Mask<S>;
    fn vand<S: Simd>(s: S, a: Self::Mask<S>, b: Self::Mask<S>) -> Self::Mask<S>;
    fn vselect<S: Simd>(
        s: S,
        mask: Self::Mask<S>,
        if_true: Self::Vector<S>,
        if_false: Self::Vector<S>,
    ) -> Self::Vector<S>;
    /// `−|a|`.
    fn vnegative<S: Simd>(s: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// Bits of `marks` or `a ⊕ b`: collects sign flips between `a` and `b`.
    fn mark_flips<S: Simd>(
        s: S,
        marks: Self::Vector<S>,
        a: Self::Vector<S>,
        b: Self::Vector<S>,
    ) -> Self::Vector<S>;
    /// Whether any lane has its sign bit set; lanes start as 1 and only collect flips of values in
    /// (0,1].
    fn any_flip<S: Simd>(s: S, marks: Self::Vector<S>) -> bool;
    /// Sum of the lanes, in a fixed order.
    fn vsum<S: Simd>(s: S, a: Self::Vector<S>) -> Self;
    /// Sum of the lanes of each register, in a fixed order; cheaper than four separate sums.
    #[inline(always)]
    fn vsums<S: Simd>(s: S, registers: [Self::Vector<S>; 4]) -> [Self; 4] {
        let [mut a, b, c, d] = Self::vrows(s, registers);
        let mut sums = [[Self::zero(); 4]; 4];
        let lanes = size_of::<Self::Vector<S>>() / size_of::<Self>();
        if lanes < 4 {
            // Fewer than four lanes: a row of four values takes several registers.
            let mut rows = [[Self::zero(); 4]; 4];
            Self::vectors_mut::<S>(rows.as_flattened_mut())[..4].copy_from_slice(&[a, b, c, d]);
            sums = rows;
        } else {
            a = Self::vadd(s, Self::vadd(s, a, b), Self::vadd(s, c, d));
            Self::vectors_mut::<S>(sums.as_flattened_mut())[0] = a;
        }
        let [a, b, c, d] = sums;
        let mut out = a;
        for (i, out) in out.iter_mut().enumerate() {
            *out = (*out + b[i]) + (c[i] + d[i]);
        }
        out
    }
    /// Largest lane.
    fn vlargest<S: Simd>(s: S, a: Self::Vector<S>) -> Self;
    /// `2^a`, relative error below 1e-7 (`f32`) or 1e-15 (`f64`) for `a` in about [−120, 120];
    /// anything, NaN included, outside.
    fn vexp2<S: Simd>(s: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// `e^a`, relative error below 2e-7 (`f32`) or 1e-14 (`f64`); 0 or infinite where that is out
    /// of range, NaN for NaN.
    fn vexp<S: Simd>(s: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// Transposes four registers of rows of four values into registers of first,
    /// second, third and fourth values. The order of the lanes depends on the
    /// instruction set but is the same for every call.
    fn vcolumns<S: Simd>(s: S, rows: [Self::Vector<S>; 4]) -> [Self::Vector<S>; 4];
    /// The inverse of [`Lane::vcolumns`].
    fn vrows<S: Simd>(s: S, columns: [Self::Vector<S>; 4]) -> [Self::Vector<S>; 4];
    /// A slice as registers; its length is a multiple of the register's.
    fn vectors<S: Simd>(slice: &[Self]) -> &[Self::Vector<S>];
    /// As [`Lane::vectors`], mutable.
    fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [Self::Vector<S>];
}

/// `f64`, the type of reference results. A trait of its own, so that `f32` can have an
/// implementation of the rasteriser that is not generic.
pub trait Reference: Lane {}

impl Reference for f64 {}

/// Runs `body` compiled for the best instruction set of this machine.
///
/// Takes the closure directly, marked `#[inline(always)]`: the bound makes it an `FnOnce`, whose
/// body is inlined into the function with the wider instruction set. Inferred as `Fn`, it would be
/// called through a shim and be compiled for the baseline.
#[inline(always)]
pub(crate) fn wide<R>(body: impl FnOnce() -> R) -> R {
    arch().dispatch(body)
}

/// The best instruction set of this machine.
#[cfg(not(test))]
pub(crate) fn arch() -> Arch {
    Arch::new()
}

#[cfg(test)]
pub(crate) use tests::arch;

/// 2^f on [−½, ½]: minimax polynomial for the relative error with the constant fixed at 1, 9.1e-8.
#[expect(clippy::approx_constant, reason = "the minimax coefficient is not quite ln 2")]
const EXP2_SINGLE: [f32; 6] =
    [1.0, 0.693_147, 0.240_222_42, 0.055_507_336, 0.009_671_513, 0.001_326_473];

/// 2^f on [−½, ½]: Taylor coefficients ln(2)^k / k!; the first omitted term is below 1e-17.
const EXP2_DOUBLE: [f64; 14] = [
    1.0,
    std::f64::consts::LN_2,
    0.240_226_506_959_100_72,
    0.055_504_108_664_821_58,
    0.009_618_129_107_628_477,
    0.001_333_355_814_642_844_3,
    0.000_154_035_303_933_816_1,
    1.525_273_380_405_984e-5,
    1.321_548_679_014_431e-6,
    1.017_808_600_923_97e-7,
    7.054_911_620_801_123e-9,
    4.445_538_271_870_811e-10,
    2.567_843_599_348_820_5e-11,
    1.369_148_885_390_412_9e-12,
];

/// `1.5·2^(mantissa bits)`: adding it rounds to the nearest integer and leaves that integer in the
/// low mantissa bits.
const ROUND_SINGLE: f32 = 12_582_912.0;
const ROUND_DOUBLE: f64 = 6_755_399_441_055_744.0;

macro_rules! lane {
    (
        $float:ident, $vector:ident, $mask:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $min:ident, $max:ident,
        $fma:ident, $fnma:ident, $le:ident, $lt:ident, $and:ident, $select:ident, $or:ident, $xor:ident, $sum:ident, $largest:ident,
        $smallest:ident, $vectors:ident, $vectors_mut:ident, $exp2:ident, $sqrt:ident, $neg:ident, $abs:ident, $exp:ident, $deinterleave:ident,
        $interleave:ident
    ) => {
        impl Lane for $float {
            type Vector<S: Simd> = S::$vector;
            type Mask<S: Simd> = S::$mask;

            #[inline(always)]
            fn vsplat<S: Simd>(s: S, x: Self) -> S::$vector {
                s.$splat(x)
            }
            #[inline(always)]
            fn vadd<S: Simd>(s: S, a: S::$vector, b: S::$vector) -> S::$vector {
                s.$add(a, b)
            }
            #[inline(always)]
            fn vsub<S: Simd>(s: S, a: S::$vector, b: S::$vector) -> S::$vector {
                s.$sub(a, b)
            }
            #[inline(always)]
            fn vmul<S: Simd>(s: S, a: S::$vector, b: S::$vector) -> S::$vector {
                s.$mul(a, b)
            }
            #[inline(always)]
            fn vdiv<S: Simd>(s: S, a: S::$vector, b: S::$vector) -> S::$vector {
                s.$div(a, b)
            }
            #[inline(always)]
            fn vmin<S: Simd>(s: S, a: S::$vector, b: S::$vector) -> S::$vector {
                s.$min(a, b)
            }
            #[inline(always)]
            fn vmax<S: Simd>(s: S, a: S::$vector, b: S::$vector) -> S::$vector {
                s.$max(a, b)
            }
            #[inline(always)]
            fn vfma<S: Simd>(s: S, a: S::$vector, b: S::$vector, c: S::$vector) -> S::$vector {
                s.$fma(a, b, c)
            }
            #[inline(always)]
            fn vfnma<S: Simd>(s: S, a: S::$vector, b: S::$vector, c: S::$vector) -> S::$vector {
                s.$fnma(a, b, c)
            }
            #[inline(always)]
            fn vsqrt<S: Simd>(s: S, a: S::$vector) -> S::$vector {
                s.$sqrt(a)
            }
            #[inline(always)]
            fn vneg<S: Simd>(s: S, a: S::$vector) -> S::$vector {
                s.$neg(a)
            }
            #[inline(always)]
            fn vabs<S: Simd>(s: S, a: S::$vector) -> S::$vector {
                s.$abs(a)
            }
            #[inline(always)]
            fn vle<S: Simd>(s: S, a: S::$vector, b: S::$vector) -> S::$mask {
                s.$le(a, b)
            }
            #[inline(always)]
            fn vlt<S: Simd>(s: S, a: S::$vector, b: S::$vector) -> S::$mask {
                s.$lt(a, b)
            }
            #[inline(always)]
            fn vand<S: Simd>(s: S, a: S::$mask, b: S::$mask) -> S::$mask {
                s.$and(a, b)
            }
            #[inline(always)]
            fn vselect<S: Simd>(s: S, m: S::$mask, a: S::$vector, b: S::$vector) -> S::$vector {
                s.$select(m, a, b)
            }
            #[inline(always)]
            fn vnegative<S: Simd>(s: S, a: S::$vector) -> S::$vector {
                s.$or(a, s.$splat(-0.0))
            }
            #[inline(always)]
            fn mark_flips<S: Simd>(
                s: S,
                marks: S::$vector,
                a: S::$vector,
                b: S::$vector,
            ) -> S::$vector {
                s.$or(marks, s.$xor(a, b))
            }
            #[inline(always)]
            fn any_flip<S: Simd>(s: S, marks: S::$vector) -> bool {
                s.$smallest(marks) < 0.0
            }
            #[inline(always)]
            fn vsum<S: Simd>(s: S, a: S::$vector) -> Self {
                s.$sum(a)
            }
            #[inline(always)]
            fn vlargest<S: Simd>(s: S, a: S::$vector) -> Self {
                s.$largest(a)
            }
            #[inline(always)]
            fn vexp2<S: Simd>(s: S, a: S::$vector) -> S::$vector {
                $exp2(s, a)
            }
            #[inline(always)]
            fn vexp<S: Simd>(s: S, a: S::$vector) -> S::$vector {
                $exp(s, a)
            }
            #[inline(always)]
            fn vcolumns<S: Simd>(s: S, rows: [S::$vector; 4]) -> [S::$vector; 4] {
                s.$deinterleave(rows)
            }
            #[inline(always)]
            fn vrows<S: Simd>(s: S, columns: [S::$vector; 4]) -> [S::$vector; 4] {
                s.$interleave(columns)
            }
            #[inline(always)]
            fn vectors<S: Simd>(slice: &[Self]) -> &[S::$vector] {
                S::$vectors(slice).0
            }
            #[inline(always)]
            fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::$vector] {
                S::$vectors_mut(slice).0
            }
        }
    };
}

lane!(
    f32,
    f32s,
    m32s,
    splat_f32s,
    add_f32s,
    sub_f32s,
    mul_f32s,
    div_f32s,
    min_f32s,
    max_f32s,
    mul_add_e_f32s,
    negate_mul_add_e_f32s,
    less_than_or_equal_f32s,
    less_than_f32s,
    and_m32s,
    select_f32s,
    or_f32s,
    xor_f32s,
    reduce_sum_f32s,
    reduce_max_f32s,
    reduce_min_f32s,
    as_simd_f32s,
    as_mut_simd_f32s,
    exp2_single,
    sqrt_f32s,
    neg_f32s,
    abs_f32s,
    exp_single,
    deinterleave_shfl_f32s,
    interleave_shfl_f32s
);
lane!(
    f64,
    f64s,
    m64s,
    splat_f64s,
    add_f64s,
    sub_f64s,
    mul_f64s,
    div_f64s,
    min_f64s,
    max_f64s,
    mul_add_e_f64s,
    negate_mul_add_e_f64s,
    less_than_or_equal_f64s,
    less_than_f64s,
    and_m64s,
    select_f64s,
    or_f64s,
    xor_f64s,
    reduce_sum_f64s,
    reduce_max_f64s,
    reduce_min_f64s,
    as_simd_f64s,
    as_mut_simd_f64s,
    exp2_double,
    sqrt_f64s,
    neg_f64s,
    abs_f64s,
    exp_double,
    deinterleave_shfl_f64s,
    interleave_shfl_f64s
);

#[inline(always)]
fn exp2_single<S: Simd>(s: S, a: S::f32s) -> S::f32s {
    let round = s.splat_f32s(ROUND_SINGLE);
    let shifted = s.add_f32s(a, round);
    let f = s.sub_f32s(a, s.sub_f32s(shifted, round));
    // Estrin's scheme has a shorter dependency chain than Horner's.
    let pair = |k: usize| {
        s.mul_add_e_f32s(f, s.splat_f32s(EXP2_SINGLE[k + 1]), s.splat_f32s(EXP2_SINGLE[k]))
    };
    let f2 = s.mul_f32s(f, f);
    let p = s.mul_add_e_f32s(s.mul_add_e_f32s(pair(4), f2, pair(2)), f2, pair(0));
    // The integer moves from the low mantissa bits into the exponent field, on top of the exponent
    // of 2^f.
    let n = s.wrapping_dyn_shl_u32s(s.transmute_u32s_f32s(shifted), s.splat_u32s(23));
    s.transmute_f32s_u32s(s.add_u32s(s.transmute_u32s_f32s(p), n))
}

/// Arguments beyond these give 0 or infinity.
const EXP_SINGLE: [f32; 2] = [-87.0, 88.0];
const EXP_DOUBLE: [f64; 2] = [-700.0, 700.0];
/// ln 2 in two parts, the first with trailing zeros, so that its multiples are exact.
const LN_2_SINGLE: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];

#[inline(always)]
fn exp_single<S: Simd>(s: S, a: S::f32s) -> S::f32s {
    let (low, high) = (s.splat_f32s(EXP_SINGLE[0]), s.splat_f32s(EXP_SINGLE[1]));
    let bounded = s.max_f32s(s.min_f32s(a, high), low);
    let round = s.splat_f32s(ROUND_SINGLE);
    let shifted = s.mul_add_e_f32s(bounded, s.splat_f32s(std::f32::consts::LOG2_E), round);
    let n = s.sub_f32s(shifted, round);
    let (ln2, rest) = (s.splat_f32s(LN_2_SINGLE[0]), s.splat_f32s(LN_2_SINGLE[1]));
    let f = s.negate_mul_add_e_f32s(n, rest, s.negate_mul_add_e_f32s(n, ln2, bounded));
    // Taylor's series on [−ln 2 / 2, ln 2 / 2].
    let mut p = s.splat_f32s(1.0 / 5040.0);
    for factorial in [720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0] {
        p = s.mul_add_e_f32s(p, f, s.splat_f32s(1.0 / factorial));
    }
    let n = s.wrapping_dyn_shl_u32s(s.transmute_u32s_f32s(shifted), s.splat_u32s(23));
    let power = s.transmute_f32s_u32s(s.add_u32s(s.transmute_u32s_f32s(p), n));
    let power = s.select_f32s(s.less_than_f32s(a, low), s.splat_f32s(0.0), power);
    // Infinity, or NaN where the argument is.
    let above = s.add_f32s(a, s.splat_f32s(f32::INFINITY));
    s.select_f32s(s.less_than_or_equal_f32s(a, high), power, above)
}

#[inline(always)]
fn exp_double<S: Simd>(s: S, a: S::f64s) -> S::f64s {
    let (low, high) = (s.splat_f64s(EXP_DOUBLE[0]), s.splat_f64s(EXP_DOUBLE[1]));
    let bounded = s.max_f64s(s.min_f64s(a, high), low);
    let power = exp2_double(s, s.mul_f64s(bounded, s.splat_f64s(std::f64::consts::LOG2_E)));
    let power = s.select_f64s(s.less_than_f64s(a, low), s.splat_f64s(0.0), power);
    let above = s.add_f64s(a, s.splat_f64s(f64::INFINITY));
    s.select_f64s(s.less_than_or_equal_f64s(a, high), power, above)
}

#[inline(always)]
fn exp2_double<S: Simd>(s: S, a: S::f64s) -> S::f64s {
    let round = s.splat_f64s(ROUND_DOUBLE);
    let shifted = s.add_f64s(a, round);
    let f = s.sub_f64s(a, s.sub_f64s(shifted, round));
    let mut p = s.splat_f64s(EXP2_DOUBLE[13]);
    for k in (0..13).rev() {
        p = s.mul_add_e_f64s(p, f, s.splat_f64s(EXP2_DOUBLE[k]));
    }
    // `pulp` has no shift for 64-bit lanes; multiplying by 2^52 modulo 2^64 is equivalent.
    let n = s.mul_u64s(s.transmute_u64s_f64s(shifted), s.splat_u64s(1 << 52));
    s.transmute_f64s_u64s(s.add_u64s(s.transmute_u64s_f64s(p), n))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::WithSimd;

    use crate::CpuRasterizer;
    use gs_core::{Camera, Rasterizer, RenderParams, Splats, UpstreamGrads};
    use std::sync::atomic::{AtomicU8, Ordering};

    /// 0: the best instruction set; 1: scalar; 2: AVX2.
    static FORCED: AtomicU8 = AtomicU8::new(0);

    pub(crate) fn arch() -> Arch {
        match FORCED.load(Ordering::Relaxed) {
            1 => Arch::Scalar,
            #[cfg(target_arch = "x86_64")]
            2 => pulp::x86::V3::try_new().map_or(Arch::Scalar, Arch::V3),
            _ => Arch::new(),
        }
    }

    /// Image, and gradients of means, quaternions, log-scales, opacity logits and harmonics.
    fn gradients() -> (Vec<f32>, [Vec<f64>; 5]) {
        let phase = |i: usize, k: usize| ((i * 37 + k * 101) % 89) as f32 / 44.0 - 1.0;
        let count = 200;
        let splats = Splats::<f32> {
            means: (0..count).map(|i| [0, 1, 2].map(|k| phase(i, k))).collect(),
            quats: (0..count).map(|i| [3, 4, 5, 6].map(|k| phase(i, k))).collect(),
            log_scales: (0..count).map(|i| [7, 8, 9].map(|k| phase(i, k) - 2.5)).collect(),
            opacity_logits: (0..count).map(|i| 3.0 * phase(i, 10)).collect(),
            // The coefficients of degree 2 do not fill whole quads.
            sh: (0..9 * count).map(|i| [11, 12, 13].map(|k| phase(i, k))).collect(),
            sh_degree: 2,
        };
        let camera = Camera::look_at([0.0, 0.0, -4.0], [0.0; 3], [0.0, -1.0, 0.0], 0.8, 70, 50);
        let (raster, params) = (CpuRasterizer::default(), RenderParams::default());
        let mut prepared = raster.prepare(&splats, &camera).unwrap();
        let out = raster.forward(&mut prepared, &splats, &[], &params).unwrap();
        let v_rgb = (0..out.rgb.len()).map(|i| phase(i, 14)).collect();
        let upstream = UpstreamGrads { v_rgb, ..UpstreamGrads::default() };
        let grads = raster.backward(&mut prepared, &splats, &[], &params, &upstream).unwrap();
        let widen = |values: &[f32]| values.iter().map(|&v| f64::from(v)).collect();
        let arrays = [
            grads.v_means.as_flattened(),
            grads.v_quats.as_flattened(),
            grads.v_log_scales.as_flattened(),
            &grads.v_opacity_logits,
            grads.v_sh.as_flattened(),
        ];
        (out.rgb, arrays.map(widen))
    }

    /// Image and gradients agree for every instruction set of
    /// this machine, so that they do on others.
    #[test]
    fn instruction_sets_agree() {
        let (best, best_grads) = gradients();
        for forced in [1, 2] {
            FORCED.store(forced, Ordering::Relaxed);
            let (other, other_grads) = gradients();
            FORCED.store(0, Ordering::Relaxed);
            let worst = best.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 5e-3, "instruction set {forced}: image differs by {worst}");
            let mean = best.iter().zip(&other).map(|(a, b)| (a - b).abs()).sum::<f32>();
            assert!(mean < 1e-6 * best.len() as f32, "instruction set {forced}: {mean}");
            for (k, (other, best)) in other_grads.iter().zip(&best_grads).enumerate() {
                let what = format!("instruction set {forced}, array {k}");
                test_support::compare::assert_grad_close(&what, other, best, 1e-3);
            }
        }
    }

    struct Exp<'a, F>(&'a mut [F]);

    impl<F: Lane> WithSimd for Exp<'_, F> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, s: S) {
            for v in F::vectors_mut::<S>(self.0) {
                *v = F::vexp(s, *v);
            }
        }
    }

    #[test]
    fn exp_is_accurate_and_total() {
        let arguments: Vec<f64> = (0..4096_u32).map(|i| f64::from(i) / 24.0 - 85.0).collect();
        let mut double = arguments.clone();
        Arch::new().dispatch(Exp(&mut double));
        let rounded: Vec<f32> = arguments.iter().map(|&x| f32::from_double(x)).collect();
        let mut single = rounded.clone();
        Arch::new().dispatch(Exp(&mut single));
        for ((x, d), (x_single, s)) in
            arguments.iter().zip(&double).zip(rounded.iter().zip(&single))
        {
            assert!((d / x.exp() - 1.0).abs() < 1e-14, "double at {x}: {d:e}");
            let truth = f64::from(*x_single).exp();
            let fits = (f64::from(*s) / truth - 1.0).abs() < 2e-7;
            assert!(fits || (*x_single > 88.0 && s.is_infinite()), "single at {x}: {s:e}");
        }
        let mut special = [0.0_f32; 16];
        special[..4].copy_from_slice(&[f32::NEG_INFINITY, f32::INFINITY, f32::NAN, -1e30]);
        Arch::new().dispatch(Exp(&mut special));
        assert!(special[0] == 0.0 && special[3] == 0.0, "far below: {special:?}");
        assert!(special[1] == f32::INFINITY && special[2].is_nan(), "{special:?}");
        assert!(special[4..].iter().all(|&x| x == 1.0), "e^0: {special:?}");
    }

    struct Exp2<'a, F>(&'a mut [F]);

    impl<F: Lane> WithSimd for Exp2<'_, F> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, s: S) {
            for v in F::vectors_mut::<S>(self.0) {
                *v = F::vexp2(s, *v);
            }
        }
    }

    #[test]
    fn exp2_is_accurate() {
        let arguments: Vec<f64> = (0..4096_u32).map(|i| -f64::from(i) / 256.0).collect();
        let mut double = arguments.clone();
        Arch::new().dispatch(Exp2(&mut double));
        let mut single: Vec<f32> = arguments.iter().map(|&x| f32::from_double(x)).collect();
        Arch::new().dispatch(Exp2(&mut single));
        for ((x, d), s) in arguments.iter().zip(&double).zip(&single) {
            let truth = x.exp2();
            assert!((d / truth - 1.0).abs() < 1e-15, "double at {x}: {d:e}");
            assert!((f64::from(*s) / truth - 1.0).abs() < 2e-7, "single at {x}: {s:e}");
        }
    }
}
