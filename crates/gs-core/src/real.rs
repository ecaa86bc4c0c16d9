//! The float types that the maths is generic over.

#![expect(clippy::inline_always, reason = "constants in vectorised loops of the rasterisers")]

use num_traits::Float;
use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// `f32` (production) or `f64` (oracle of finite differences).
///
/// Constants of the reference are single-precision: [`Real::of`] widens an `f32`, so an `f64` run
/// uses the very same thresholds.
pub trait Real:
    Float
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + Sum
    + Default
    + Debug
    + Send
    + Sync
    + 'static
{
    /// Widens (or keeps) a single-precision constant.
    fn of(value: f32) -> Self;
    /// Rounds (or keeps) a double.
    fn from_double(value: f64) -> Self;
    /// As double.
    fn as_f64(self) -> f64;
    /// As single, rounded.
    fn as_f32(self) -> f32;
}

/// What polynomials need: one number, or a register of numbers.
pub trait Ring:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// A single-precision constant of the same kind as `self`.
    #[must_use]
    fn like(self, constant: f32) -> Self;
}

impl<F: Real> Ring for F {
    #[inline(always)]
    fn like(self, constant: f32) -> Self {
        F::of(constant)
    }
}

impl Real for f32 {
    fn of(value: f32) -> Self {
        value
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding to single is what this function is for"
    )]
    fn from_double(value: f64) -> Self {
        value as f32
    }
    fn as_f64(self) -> f64 {
        f64::from(self)
    }
    fn as_f32(self) -> f32 {
        self
    }
}

impl Real for f64 {
    fn of(value: f32) -> Self {
        f64::from(value)
    }
    fn from_double(value: f64) -> Self {
        value
    }
    fn as_f64(self) -> f64 {
        self
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding to single is what this function is for"
    )]
    fn as_f32(self) -> f32 {
        self as f32
    }
}
