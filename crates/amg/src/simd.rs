//! Loops compiled for the best instruction set of the machine, chosen at run time, and a few
//! numbers computed at once.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Runs `body` compiled for the best instruction set of this machine. Mark the closure
/// `#[inline(always)]`, and every function it calls that should be vectorised too; adaptors of
/// iterators are not. Nothing in such bodies may depend on how sums are grouped: results are the
/// same everywhere.
///
/// The twin of `dispatch` in `uot/src/simd.rs`, which is not part of that crate's interface.
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

/// `L` numbers with the arithmetic of one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(transparent)]
pub(crate) struct Lanes<const L: usize>(pub(crate) [f64; L]);

impl<const L: usize> Lanes<L> {
    pub(crate) const ZERO: Self = Self([0.0; L]);

    /// The same number in each lane.
    #[inline(always)]
    pub(crate) fn all(value: f64) -> Self {
        Self([value; L])
    }

    #[inline(always)]
    pub(crate) fn map(mut self, f: impl Fn(f64) -> f64) -> Self {
        for value in &mut self.0 {
            *value = f(*value);
        }
        self
    }

    /// `other` in the lanes set in `choose`, `self` elsewhere.
    #[inline(always)]
    pub(crate) fn select(mut self, choose: [bool; L], other: Self) -> Self {
        for lane in 0..L {
            self.0[lane] = if choose[lane] { other.0[lane] } else { self.0[lane] };
        }
        self
    }
}

macro_rules! lane_by_lane {
    ($trait:ident, $method:ident, $op:tt) => {
        impl<const L: usize> $trait for Lanes<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for lane in 0..L {
                    self.0[lane] $op other.0[lane];
                }
                self
            }
        }
    };
}

lane_by_lane!(Add, add, +=);
lane_by_lane!(Sub, sub, -=);
lane_by_lane!(Mul, mul, *=);

impl<const L: usize> AddAssign for Lanes<L> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const L: usize> Neg for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|value| -value)
    }
}
