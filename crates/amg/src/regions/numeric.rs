//! Numerical helpers of the estimates.

/// Lower bound of lengths that are divided by; its square is still positive.
pub(super) const TINY: f64 = 1e-100;
