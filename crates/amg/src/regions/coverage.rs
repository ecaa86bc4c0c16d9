//! Relaxed source marginal: a cost for regions with more edited splats than their share.
//!
//! If an edit pushes two surfaces through each other, each is at the expected position of the
//! other, and by offsets alone both are assigned to one of them: one region then has twice its
//! share of splats, the other none. As with the relaxed marginal of unbalanced transport, the cost
//! is the negative dual potential: λ₁ times the logarithm of the filling ratio, with one damped
//! step per alternation. Counts are smoothed over a patch and compared with the rate of the body
//! part, because single regions contain too few splats.

use super::diffusion::Diffusion;

/// Number of diffusion steps that smooth counts over a patch, and over the body part with which it
/// is compared.
const PATCH: usize = 3;
const PART: usize = 40;

/// Prior count, as a share of the expected count. Keeps the filling ratio finite where all splats
/// were deleted.
const PRIOR: f64 = 0.3;

/// Bound on the filling ratio and its inverse: an edit may also remove or add a part.
const LIMIT: f64 = std::f64::consts::E;

/// Share of the previous cost that is kept in each step.
const DAMPING: f64 = 0.5;

/// Updates `penalty` `[R]`, nats, from `counts` `[R]`: edited splats assigned to each region, and
/// its source splats. `strength` is λ₁.
pub(super) fn update(
    diffusion: &Diffusion,
    counts: Vec<[f64; 2]>,
    strength: f64,
    penalty: &mut [f64],
) {
    let near = diffusion.spread(counts, PATCH);
    let wide = diffusion.spread(near.clone(), PART - PATCH);
    for ((penalty, near), wide) in penalty.iter_mut().zip(near).zip(wide) {
        let expected = wide[0] / wide[1] * near[1];
        let filling = (near[0] + PRIOR * expected) / ((1.0 + PRIOR) * expected);
        // The rate of a part without edited splats is undefined.
        let defined = filling > 0.0 && filling.is_finite();
        let new = if defined { strength * filling.clamp(LIMIT.recip(), LIMIT).ln() } else { 0.0 };
        *penalty = DAMPING * *penalty + (1.0 - DAMPING) * new;
    }
}
