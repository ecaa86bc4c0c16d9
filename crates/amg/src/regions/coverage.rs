//! The relaxed source marginal: a cost for regions that have more edited splats than their share.
//!
//! Where an edit pushes two surfaces through each other, each lies where the other is expected.
//! Judged splat by splat, both are assigned to one of them, which then has twice its share of splats
//! while the other has none. The cost is the potential of the relaxed marginal of unbalanced
//! transport, λ₁ times the logarithm of the fill, updated by one damped step per alternation. The
//! fill is the number of edited splats per source splat in a patch, relative to that of the body
//! part: single regions have too few splats.

use super::diffusion::{Diffusion, PATCH};

/// Steps of diffusion for the body part, whose diameter is about three times that of a patch: it
/// grows with the root of the number of steps.
const PART: usize = 10 * PATCH;

/// Prior count of edited splats, as a share of the expected number: keeps the logarithm finite for
/// parts whose splats were all deleted.
const PRIOR: f64 = 0.3;

/// Share of the previous value that is kept: full steps oscillate.
const DAMPING: f64 = 0.5;

/// Updates `crowding` `[R]`, nats, from the numbers of edited splats and of source splats of each
/// region; `strength` is λ₁.
pub(super) fn update(
    diffusion: &Diffusion,
    counts: Vec<[f64; 2]>,
    strength: f64,
    crowding: &mut [f64],
) {
    let near = diffusion.spread(counts, PATCH);
    let wide = diffusion.spread(near.clone(), PART - PATCH);
    for ((crowding, near), wide) in crowding.iter_mut().zip(near).zip(wide) {
        let expected = wide[0] / wide[1] * near[1];
        let filled = (near[0] + PRIOR * expected) / ((1.0 + PRIOR) * expected);
        // The fill is undefined for parts without edited splats.
        let is_defined = filled > 0.0 && filled.is_finite();
        let new = if is_defined { strength * filled.ln() } else { 0.0 };
        *crowding = DAMPING * *crowding + (1.0 - DAMPING) * new;
    }
}
