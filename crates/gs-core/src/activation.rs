//! Activations between stored and used parameters.

use crate::Real;

/// `1 / (1 + e^{−x})`: stored logit to opacity in (0,1).
pub fn sigmoid<F: Real>(x: F) -> F {
    F::one() / (F::one() + (-x).exp())
}

/// `ln(p / (1 − p))`: opacity in (0,1) to stored logit.
pub fn logit<F: Real>(p: F) -> F {
    (p / (F::one() - p)).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logit_inverts_sigmoid() {
        for x in [-9.0_f64, -1.0, 0.0, 0.3, 8.0] {
            assert!((logit(sigmoid(x)) - x).abs() < 1e-9, "at {x}");
        }
    }

    #[test]
    fn sigmoid_saturates_without_nan() {
        assert!(sigmoid(f32::NEG_INFINITY).abs() < f32::MIN_POSITIVE, "−∞ is transparent");
        assert!((sigmoid(f32::INFINITY) - 1.0).abs() < f32::EPSILON, "+∞ is opaque");
    }
}
