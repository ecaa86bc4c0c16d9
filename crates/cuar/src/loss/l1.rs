//! Masked L1.

use gs_core::Real;

/// `norm · Σ m·|x − y|` over `[P,C]` values with one weight `m ≥ 0` per pixel (`[P]`), and its
/// derivative with respect to `x`, **added** to `v_x`. The mean over the image is `norm = 1/(P·C)`.
/// The derivative at `x = y` is 0.
///
/// # Panics
/// If the lengths differ.
pub fn masked_l1<F: Real>(x: &[F], y: &[F], mask: &[F], norm: F, v_x: &mut [F]) -> F {
    assert!(
        x.len() == y.len() && x.len() == v_x.len() && x.len().is_multiple_of(mask.len().max(1)),
        "masked_l1: {} and {} values, {} gradients, {} pixels",
        x.len(),
        y.len(),
        v_x.len(),
        mask.len()
    );
    let channels = x.len() / mask.len().max(1);
    let mut sum = F::zero();
    for (p, &m) in mask.iter().enumerate() {
        if m > F::zero() {
            for k in p * channels..(p + 1) * channels {
                let difference = x[k] - y[k];
                sum += m * difference.abs();
                v_x[k] += norm * m * sign(difference);
            }
        }
    }
    norm * sum
}

/// −1, 0 or 1.
pub(crate) fn sign<F: Real>(x: F) -> F {
    if x > F::zero() {
        F::one()
    } else if x < F::zero() {
        -F::one()
    } else {
        F::zero()
    }
}
