//! The source's marginal: what belonging to a region costs because of who else does.
//!
//! Where an edit pushes two surfaces through each other, each lies where the other is expected, and
//! splat by splat both look like one. But then that one has twice its share of splats and the other
//! has none. So regions are held to their share, as by the relaxed marginal of unbalanced
//! transport, whose dual this is: λ₁ times the logarithm of how full they are, one damped step for
//! each alternation. Counts are those of a smooth patch, against the rate of the body part: single
//! regions have too few splats.

use super::diffusion::Diffusion;

/// Steps of spreading: the patch looked at, and the body part it is compared with.
const PATCH: usize = 3;
const PART: usize = 40;

/// Splats that every region is believed to have, as a share of its own: parts of which nothing is
/// left are not crowded.
const PRIOR: f64 = 0.3;

/// Fuller or emptier than this by a factor, a patch costs or gains no more: edits remove parts,
/// too.
const LIMIT: f64 = std::f64::consts::E;

/// Share of the old cost kept from step to step.
const DAMPING: f64 = 0.5;

/// Updates `crowding` `[R]`, nats, from the number of edited splats that belong to each region and
/// of its source splats; `strength` is λ₁.
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
        // Parts that nothing belongs to have no rate.
        let known = filled > 0.0 && filled.is_finite();
        let new = if known { strength * filled.clamp(LIMIT.recip(), LIMIT).ln() } else { 0.0 };
        *crowding = DAMPING * *crowding + (1.0 - DAMPING) * new;
    }
}
