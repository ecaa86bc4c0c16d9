//! Numeric loops shared by the kernels, written for vectorisation by the compiler.
//!
//! `mul_add` is used throughout: it is exact by definition, so results do not depend on the
//! instruction set that [`pulp::Arch`] picks at run time.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

/// Lanes of one block row; points are stored in groups of this many.
pub(crate) const LANES: usize = 8;
/// One group of lanes.
pub(crate) type Lane = [f64; LANES];

/// Runs `body` compiled for the best instruction set of this machine. Mark the closure
/// `#[inline(always)]`, and every function it calls that should be vectorised too.
///
/// Takes `FnMut`: a call of a closure by value goes through a shim that is not inlined, so that the
/// body would be outside the dispatched function.
///
/// The same function is in `amg/src/simd.rs`.
pub(crate) fn dispatch<R>(body: impl FnMut() -> R) -> R {
    struct Body<F>(F);
    impl<R, F: FnMut() -> R> pulp::WithSimd for Body<F> {
        type Output = R;
        #[inline(always)]
        fn with_simd<S: pulp::Simd>(mut self, _: S) -> R {
            (self.0)()
        }
    }
    pulp::Arch::new().dispatch(Body(body))
}

/// `e^x` with a relative error below 3e-16; exactly 0 below −708, saturated above 709.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    // 1.5·2^52: adding it rounds to an integer, which is then in the low bits
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    const LN2_HI: f64 = 6.931_471_803_691_238e-1;
    const LN2_LO: f64 = 1.908_214_929_270_587_7e-10;
    const INVERSE_FACTORIALS: [f64; 13] = [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        1.0 / 2.0,
        1.0,
        1.0,
    ];
    let clamped = x.clamp(-708.0, 709.0);
    let shifted = clamped.mul_add(std::f64::consts::LOG2_E, MAGIC);
    let whole = shifted - MAGIC;
    let r = whole.mul_add(-LN2_LO, whole.mul_add(-LN2_HI, clamped));
    // Taylor series to r^13: the remainder is below half a unit in the last place for |r| ≤ ln 2 /
    // 2
    let mut p = 1.0 / 6_227_020_800.0_f64;
    for coefficient in INVERSE_FACTORIALS {
        p = p.mul_add(r, coefficient);
    }
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    if x < -708.0 { 0.0 } else { p * power }
}

/// `out = e^(x − shift)`, elementwise.
pub(crate) fn exp_shifted(x: &[f64], shift: f64, out: &mut [f64]) {
    dispatch(
        #[inline(always)]
        || {
            for (o, &value) in out.iter_mut().zip(x) {
                *o = exp(value - shift);
            }
        },
    );
}

/// Sum in a fixed order that has eight independent chains.
pub(crate) fn sum(values: &[f64]) -> f64 {
    let (groups, rest) = values.as_chunks::<LANES>();
    let mut acc = [0.0; LANES];
    for group in groups {
        for lane in 0..LANES {
            acc[lane] += group[lane];
        }
    }
    fold(acc) + rest.iter().sum::<f64>()
}

/// Sum of the lanes, pairwise.
#[inline(always)]
pub(crate) fn fold(a: Lane) -> f64 {
    ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_matches_the_standard_library() {
        let mut worst = 0.0_f64;
        for step in 0..400_000 {
            let x = -707.0 + f64::from(step) * 0.003_5;
            let x = x.min(708.0);
            worst = worst.max((exp(x) / x.exp() - 1.0).abs());
        }
        assert!(worst < 5e-16, "worst relative error {worst:e}");
        assert!(exp(-709.0) == 0.0 && exp(f64::NEG_INFINITY) == 0.0, "underflow is zero");
        assert!(exp(0.0).to_bits() == 1.0_f64.to_bits(), "exp(0) is exactly 1");
        assert!(exp(f64::NAN).is_nan(), "NaN stays NaN");
    }

    #[test]
    fn sum_handles_every_remainder() {
        for len in 0..40_u32 {
            let values: Vec<f64> = (0..len).map(f64::from).collect();
            let expected = f64::from(len) * (f64::from(len) - 1.0) / 2.0;
            assert!((sum(&values) - expected).abs() < 1e-12, "length {len}");
        }
    }
}
