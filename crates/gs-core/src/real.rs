//! The float types over which the maths is generic.

#![expect(clippy::inline_always, reason = "constants in vectorised loops of the rasterisers")]

use num_traits::Float;
use num_traits::float::TotalOrder;
use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// `f32` (production) or `f64` (reference for finite differences).
///
/// Constants of the reference are single-precision: [`Real::of`] widens an `f32`, so an `f64` run
/// uses exactly the same thresholds.
pub trait Real:
    Float
    + TotalOrder
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
    /// Converts from single precision, exactly.
    fn of(value: f32) -> Self;
    /// Converts from double precision, rounded to `Self`.
    fn from_double(value: f64) -> Self;
    /// The value in double precision.
    fn as_f64(self) -> f64;
    /// The value rounded to single precision.
    fn as_f32(self) -> f32;
}

/// Addition, subtraction and multiplication for polynomials: a single number or a SIMD register.
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
    #[expect(clippy::cast_possible_truncation, reason = "this function rounds to single precision")]
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
    #[expect(clippy::cast_possible_truncation, reason = "this function rounds to single precision")]
    fn as_f32(self) -> f32 {
        self as f32
    }
}
