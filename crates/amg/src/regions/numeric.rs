//! Numerical helpers of the estimates.

/// Lower bound of lengths that are divided by; its square is still positive.
pub(super) const TINY: f64 = 1e-100;

/// Upper median, 0 for an empty slice. Reorders `values`.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
