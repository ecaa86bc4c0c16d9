//! Comparators. Each has a negative control below, a test in which it fails.

/// Largest absolute difference; infinite if exactly one side is not finite or the lengths differ.
pub fn max_abs_diff(actual: &[f64], expected: &[f64]) -> f64 {
    if actual.len() != expected.len() {
        return f64::INFINITY;
    }
    let mut worst = 0.0_f64;
    for (&a, &e) in actual.iter().zip(expected) {
        let same_nonfinite = a.to_bits() == e.to_bits() || (a.is_nan() && e.is_nan());
        let difference = if same_nonfinite { 0.0 } else { (a - e).abs() };
        worst = if difference.is_nan() { f64::INFINITY } else { worst.max(difference) };
        if worst.is_infinite() {
            return worst;
        }
    }
    worst
}

/// Relative L2 error `‖a − e‖ / ‖e‖`; the norm of `a` if `e` is zero.
pub fn relative_l2(actual: &[f64], expected: &[f64]) -> f64 {
    if actual.len() != expected.len() {
        return f64::INFINITY;
    }
    let error: f64 = actual.iter().zip(expected).map(|(a, e)| (a - e).powi(2)).sum();
    let norm: f64 = expected.iter().map(|e| e * e).sum();
    let value = if norm > 0.0 { (error / norm).sqrt() } else { error.sqrt() };
    if value.is_nan() { f64::INFINITY } else { value }
}

/// Prints the errors of a check that passes, if `C4D_SHOW_ERRORS` is set: the values that the
/// tables of tolerances state.
pub fn show_errors(what: &str, errors: std::fmt::Arguments<'_>) {
    if std::env::var_os("C4D_SHOW_ERRORS").is_some() {
        eprintln!("{what}: {errors}");
    }
}

/// Widens to `f64` for the comparators.
pub fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&value| f64::from(value)).collect()
}

/// Asserts `|a − e| ≤ atol + rtol·|e|` for every element.
///
/// # Panics
/// If the bound is exceeded, the lengths differ, or exactly one
/// side is not finite; names the worst element.
#[track_caller]
pub fn assert_close(what: &str, actual: &[f64], expected: &[f64], atol: f64, rtol: f64) {
    assert_eq!(actual.len(), expected.len(), "{what}: lengths differ");
    let mut worst = (0, 0.0_f64);
    for (index, (&a, &e)) in actual.iter().zip(expected).enumerate() {
        let same = a.to_bits() == e.to_bits() || (a.is_nan() && e.is_nan());
        let excess = if same { 0.0 } else { (a - e).abs() / (atol + rtol * e.abs()) };
        let excess = if excess.is_nan() { f64::INFINITY } else { excess };
        if excess > worst.1 {
            worst = (index, excess);
        }
    }
    assert!(
        worst.1 <= 1.0,
        "{what}: element {} is {:e}, expected {:e}; {:.3} times the tolerance (atol {atol:e}, rtol {rtol:e})",
        worst.0,
        actual[worst.0],
        expected[worst.0],
        worst.1
    );
}

/// Compares gradients as vectors: relative L2 error and largest error over largest entry are both
/// at most `limit`, and the gradient is not all zero unless the expected one is.
///
/// # Panics
/// When a measure exceeds the limit.
#[track_caller]
pub fn assert_grad_close(what: &str, actual: &[f64], expected: &[f64], limit: f64) {
    let l2 = relative_l2(actual, expected);
    assert!(l2 <= limit, "{what}: relative L2 error {l2:e} exceeds {limit:e}");
    let largest = expected.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
    let worst = max_abs_diff(actual, expected);
    assert!(
        worst <= limit * largest.max(f64::MIN_POSITIVE) || worst == 0.0,
        "{what}: largest error {worst:e} exceeds {limit:e} of the largest entry {largest:e}"
    );
    show_errors(what, format_args!("{:.1e}", l2.max(worst / largest.max(f64::MIN_POSITIVE))));
    let all_zero = actual.iter().all(|&a| a == 0.0);
    assert!(!all_zero || largest == 0.0, "{what}: gradient is all zero");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "element 1")]
    fn close_fails_on_a_wrong_element() {
        assert_close("x", &[1.0, 2.1], &[1.0, 2.0], 1e-3, 1e-3);
    }

    #[test]
    #[should_panic(expected = "element 0")]
    fn close_fails_on_nan() {
        assert_close("x", &[f64::NAN], &[1.0], 1e9, 1e9);
    }

    #[test]
    #[should_panic(expected = "lengths differ")]
    fn close_fails_on_length() {
        assert_close("x", &[1.0], &[1.0, 2.0], 1.0, 1.0);
    }

    #[test]
    #[should_panic(expected = "relative L2")]
    fn gradient_fails_when_all_zero() {
        assert_grad_close("g", &[0.0, 0.0], &[1e-9, 0.0], 0.5);
    }

    #[test]
    #[should_panic(expected = "largest error")]
    fn gradient_fails_on_one_bad_entry_among_many() {
        let expected: Vec<f64> = (0..1000).map(|_| 1.0).collect();
        let mut actual = expected.clone();
        actual[7] = 1.05;
        assert_grad_close("g", &actual, &expected, 1e-2);
    }

    #[test]
    fn equal_passes() {
        assert_close("x", &[1.0, f64::NAN], &[1.0, f64::NAN], 0.0, 0.0);
        assert_grad_close("g", &[0.0], &[0.0], 1e-12);
        assert!(max_abs_diff(&[f64::INFINITY], &[1.0]).is_infinite(), "one infinite side");
        assert!(relative_l2(&[f64::NAN], &[1.0]).is_infinite(), "NaN is never close");
    }
}
