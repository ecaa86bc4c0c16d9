//! [`median`].

/// Median; the midpoint of the two middle values for an even number, 0 for an empty slice. Reorders
/// `values`.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    let even = values.len().is_multiple_of(2);
    let (below, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if even {
        0.5 * (*upper + below.iter().copied().fold(f64::NEG_INFINITY, f64::max))
    } else {
        *upper
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_even_and_empty_slices() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0, "the middle one");
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 8.0]), 3.0, "between the two middle ones");
        assert_eq!(median(&mut []), 0.0, "an empty slice");
    }
}
