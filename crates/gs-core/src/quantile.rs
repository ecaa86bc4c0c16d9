//! Medians and quantiles, with their conventions. Values are in the order of `total_cmp`; NaN is
//! beyond the infinities. Each function returns `None` for no values.

use crate::Real;

/// Median: the middle value, or the mean of the two middle values of an even number, as in NumPy.
/// Reorders `values`.
pub fn median<F: Real>(values: &mut [F]) -> Option<F> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    let even = values.len().is_multiple_of(2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, F::total_cmp);
    let lower = below.iter().copied().max_by(F::total_cmp).filter(|_| even);
    Some(lower.map_or(upper, |lower| F::of(0.5) * (upper + lower)))
}

/// Quantile: the value at position `share · (n − 1)` of the sorted values, linear between the two
/// nearest (NumPy's default, type 7 of Hyndman and Fan). `share` is between 0 and 1. Reorders
/// `values`.
pub fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let position = share * values.len().checked_sub(1)? as f64;
    let below = index(position.floor());
    let (_, &mut low, above) = values.select_nth_unstable_by(below, f64::total_cmp);
    let high = above.iter().copied().min_by(f64::total_cmp).unwrap_or(low);
    Some(low + (high - low) * (position - position.floor()))
}

/// Quantile that is one of the values: the one at position `share · (n − 1)` of the sorted values,
/// rounded; halves are rounded up, so a share of 0.5 gives the upper of two middle values. `share`
/// is between 0 and 1. Reorders `values`.
pub fn nearest_rank<F: Real>(values: &mut [F], share: f64) -> Option<F> {
    let last = values.len().checked_sub(1)?;
    let rank = index((share * last as f64).round());
    Some(*values.select_nth_unstable_by(rank, F::total_cmp).1)
}

/// Weighted quantile of `(value, weight)` pairs: the smallest value up to which `share` of the
/// total weight lies. `share` is between 0 and 1.
pub fn weighted_quantile<F: Real>(mut values: Vec<(F, F)>, share: F) -> Option<F> {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let target = share * values.iter().map(|(_, weight)| *weight).sum::<F>();
    let mut passed = F::zero();
    for (value, weight) in &values {
        passed += *weight;
        if passed >= target {
            return Some(*value);
        }
    }
    values.last().map(|(value, _)| *value)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a share of a length is a valid index"
)]
fn index(position: f64) -> usize {
    position as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0), "odd");
        assert_eq!(median(&mut [4.0_f32, 1.0, 2.0, 8.0]), Some(3.0), "even");
        assert_eq!(median::<f64>(&mut []), None, "none");
    }

    #[test]
    fn quantiles_are_linear_between_ranks() {
        assert_eq!(quantile(&mut [3.0, 1.0, 2.0], 0.5), Some(2.0), "a rank");
        assert_eq!(quantile(&mut [1.0, 0.0], 0.9), Some(0.9), "between ranks");
        assert_eq!(quantile(&mut [1.0, 0.0], 1.0), Some(1.0), "the largest");
        assert_eq!(quantile(&mut [7.0], 0.9), Some(7.0), "one");
        assert_eq!(quantile(&mut [], 0.9), None, "none");
    }

    #[test]
    fn the_nearest_rank_is_a_value() {
        assert_eq!(nearest_rank(&mut [4.0_f32, 1.0, 2.0, 8.0], 0.5), Some(4.0), "upper median");
        assert_eq!(nearest_rank(&mut [3.0, 1.0, 2.0], 0.5), Some(2.0), "median");
        assert_eq!(nearest_rank(&mut [3.0, 1.0, 2.0], 0.0), Some(1.0), "the smallest");
        assert_eq!(nearest_rank(&mut [3.0, 1.0, 2.0], 1.0), Some(3.0), "the largest");
        assert_eq!(nearest_rank::<f64>(&mut [], 0.5), None, "none");
    }

    #[test]
    fn weighted_quantiles_follow_the_weights() {
        let equal = vec![(3.0_f32, 1.0), (1.0, 1.0), (2.0, 1.0)];
        assert_eq!(weighted_quantile(equal, 0.5), Some(2.0), "median");
        let heavy = vec![(3.0, 5.0), (1.0, 1.0), (2.0, 1.0)];
        assert_eq!(weighted_quantile(heavy, 0.5), Some(3.0), "most of the weight");
        assert_eq!(weighted_quantile::<f64>(Vec::new(), 0.5), None, "none");
    }
}
