//! Numerical constants.

/// Lower bound of lengths in denominators; its square does not underflow.
pub(super) const TINY: f64 = 1e-100;
