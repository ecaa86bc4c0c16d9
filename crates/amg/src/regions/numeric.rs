//! Numerical constants of several estimates.

/// Lower bound of lengths that are divided by; its square is still positive.
pub(super) const TINY: f64 = 1e-100;
