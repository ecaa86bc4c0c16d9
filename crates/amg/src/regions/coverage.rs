//! The relaxed source marginal: a cost for regions that have more edited splats than their share.
//!
//! Where an edit pushes two surfaces through each other, each lies where the other is expected.
//! Judged splat by splat, both are assigned to one of them, which then has twice its share of splats
//! while the other has none. The cost is the potential of the relaxed marginal of unbalanced
//! transport, λ₁ times the logarithm of the fill, updated by one damped step per alternation. The
//! fill is the number of edited splats per source splat in a patch, relative to that of the body
//! part: single regions have too few splats.

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
        let known = filled > 0.0 && filled.is_finite();
        let new = if known { strength * filled.clamp(LIMIT.recip(), LIMIT).ln() } else { 0.0 };
        *crowding = DAMPING * *crowding + (1.0 - DAMPING) * new;
    }
}
