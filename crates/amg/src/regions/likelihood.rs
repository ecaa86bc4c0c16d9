//! What it costs an edited splat to belong to a region: a negative log-likelihood, in nats.

use super::candidates::Candidate;
use super::numeric::TINY;
use gs_core::Real;

/// Squared offsets, in standard deviations, beyond which more offset costs ever less: the Welsch
/// cost of Eq. 21 with the learned spread for its scale. Half of it is the cost of leaving the
/// surface altogether.
const WELSCH: f64 = 12.0;

/// Offsets are told apart no better than this share of the spacing: discs are rough.
const ROUGHNESS: f64 = 0.1;

/// What is known, or believed, of the edited splats of one region.
#[derive(Debug, Clone, Copy)]
pub(super) struct Statistics {
    /// Mean signed offset along the outward normal, world units.
    pub(super) mean: f64,
    /// Its standard deviation, world units.
    pub(super) sigma: f64,
    /// Mean `1 − |cos|` between normals.
    pub(super) misaligned: f64,
    /// Mean squared difference of flatness.
    pub(super) unlike: f64,
}

/// The cost of belonging to one region, as factors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Likelihood {
    mean: f32,
    per_offset: f32,
    per_tangent: f32,
    per_misaligned: f32,
    per_unlike: f32,
}

impl Likelihood {
    /// `spacing` is that of the regions; `alignment` the cost of the typical misalignment.
    pub(super) fn of(statistics: &Statistics, spacing: f64, alignment: f64) -> Self {
        let Statistics { mean, sigma, misaligned, unlike } = *statistics;
        let across = (sigma * sigma + (ROUGHNESS * spacing).powi(2)).max(TINY * TINY);
        // Along the surface a region reaches as far as its neighbours, and as far as what it wears.
        let along = spacing * spacing + across + mean * mean;
        Self {
            mean: mean.as_f32(),
            per_offset: across.recip().as_f32(),
            per_tangent: along.recip().as_f32(),
            per_misaligned: (alignment / misaligned).as_f32(),
            per_unlike: unlike.recip().as_f32(),
        }
    }

    /// Half the squared distances, across (if both are flat: a ball has no side) and along the
    /// surface, and the squared difference of flatness, in units of their variances; and the
    /// misalignment in units of its mean.
    pub(super) fn cost(&self, of: &Candidate) -> f32 {
        let welsch = WELSCH.as_f32();
        let across = (of.offset - self.mean).powi(2) * self.per_offset;
        let across = welsch * (1.0 - (-across / welsch).exp());
        let ball = of.offset * of.offset * self.per_tangent;
        let along = of.tangent_squared * self.per_tangent;
        let unlike = of.unlike * self.per_unlike;
        0.5 * (of.flat * across + (1.0 - of.flat) * ball + along + unlike)
            + self.per_misaligned * of.misaligned
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DISPLACED: Statistics =
        Statistics { mean: 0.02, sigma: 0.003, misaligned: 0.1, unlike: 0.1 };

    fn candidate(offset: f32, flat: f32, misaligned: f32) -> Candidate {
        Candidate {
            region: 0,
            hypothesis: 0,
            offset,
            tangent_squared: 0.0,
            flat,
            misaligned,
            unlike: 0.0,
        }
    }

    #[test]
    fn splats_are_expected_where_the_edit_pushed_the_surface() {
        let likelihood = Likelihood::of(&DISPLACED, 0.01, 2.0);
        let [worn, on_surface, inside] =
            [0.02, 0.0, -0.02].map(|offset| likelihood.cost(&candidate(offset, 1.0, 0.0)));
        assert!(
            worn < 1e-6 && worn + 4.0 < on_surface && on_surface <= inside,
            "{worn} {on_surface} {inside}"
        );
        assert!(inside <= 0.5 * 12.0, "leaving costs no more than the Welsch cost: {inside}");
    }

    #[test]
    fn balls_have_no_side_and_normals_may_be_misaligned_as_they_are_everywhere() {
        let likelihood = Likelihood::of(&DISPLACED, 0.01, 2.0);
        let [out, inside] =
            [0.02, -0.02].map(|offset| likelihood.cost(&candidate(offset, 0.0, 0.0)));
        assert!((out - inside).abs() < 1e-6, "{out} and {inside}");
        let tilted = likelihood.cost(&candidate(0.02, 1.0, 0.1));
        assert!((tilted - 2.0).abs() < 1e-3, "the typical misalignment: {tilted}");
    }
}
