//! Selection of the best of several values.

use c4d_metrics::Better;

/// Relative difference in badness below which values count as equal, because they print the same
/// with four digits.
const SAME: f64 = 5e-4;

/// Indices of the best values; several if they are equal with four digits. Empty if all are equal
/// or the metric has no preferred direction.
pub(crate) fn best(better: Better, values: &[Option<f64>]) -> Vec<usize> {
    let badness: Vec<Option<f64>> =
        values.iter().map(|value| value.and_then(|value| better.badness(value))).collect();
    let Some(lowest) = badness.iter().flatten().copied().min_by(f64::total_cmp) else {
        return Vec::new();
    };
    let is_best = |bad: f64| bad <= lowest + SAME * lowest.abs();
    let found: Vec<usize> =
        (0..values.len()).filter(|&k| badness[k].is_some_and(is_best)).collect();
    let known = badness.iter().flatten().count();
    if found.len() == known { Vec::new() } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_are_found() {
        let values = [Some(1.0), None, Some(3.0), Some(3.0001)];
        assert_eq!(best(Better::Higher, &values), [2, 3], "two are the same");
        assert_eq!(best(Better::Lower, &values), [0], "one");
        assert!(best(Better::Neither, &values).is_empty(), "none is better");
        assert!(best(Better::Lower, &[Some(0.0), Some(0.0)]).is_empty(), "all are");
    }
}
