//! What several estimates share.

/// Stands in for lengths that are zero; its square is a positive number, too.
pub(super) const TINY: f64 = 1e-100;

/// The middle value, the upper one of two, 0 of none. Reorders.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
