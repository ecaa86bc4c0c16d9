//! Cost of an edited splat belonging to a region: a negative log-likelihood, in nats.

use super::candidates::Candidate;
use super::numeric::TINY;
use gs_core::Real;

/// Width of the Welsch cost (Eq. 21) of the offset along the normal, variances: half of it is the
/// largest cost.
const WELSCH: f64 = 12.0;

/// Statistics of the edited splats of one region.
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

/// Precomputed factors of the cost of one region.
#[derive(Debug, Clone, Copy)]
pub(super) struct Likelihood {
    mean: f32,
    per_offset: f32,
    per_tangent: f32,
    per_misaligned: f32,
    per_unlike: f32,
}

impl Likelihood {
    /// `spacing` is the distance between regions, world units; `alignment` the cost of the mean
    /// misalignment, nats.
    pub(super) fn of(statistics: &Statistics, spacing: f64, alignment: f64) -> Self {
        let Statistics { mean, sigma, misaligned, unlike } = *statistics;
        let across = (sigma * sigma).max(TINY * TINY);
        // Along the surface a region extends to its neighbours, farther where the edit displaced it.
        let along = spacing * spacing + across + mean * mean;
        Self {
            mean: mean.as_f32(),
            per_offset: across.recip().as_f32(),
            per_tangent: along.recip().as_f32(),
            per_misaligned: (alignment / misaligned).as_f32(),
            per_unlike: unlike.recip().as_f32(),
        }
    }

    /// Half the squared offset along the normal (for flat splats; otherwise half the squared
    /// distance), half the squared distance in the tangent plane and half the squared difference of
    /// flatness, each over its variance; plus the misalignment over its mean.
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
    fn cost_is_lowest_at_the_learned_offset() {
        let likelihood = Likelihood::of(&DISPLACED, 0.01, 2.0);
        let [displaced, on_surface, inside] =
            [0.02, 0.0, -0.02].map(|offset| likelihood.cost(&candidate(offset, 1.0, 0.0)));
        assert!(
            displaced < 1e-6 && displaced + 4.0 < on_surface && on_surface <= inside,
            "{displaced} {on_surface} {inside}"
        );
        assert!(f64::from(inside) <= 0.5 * WELSCH, "the Welsch cost is bounded: {inside}");
    }

    #[test]
    fn balls_have_no_side_and_mean_misalignment_costs_alignment() {
        let likelihood = Likelihood::of(&DISPLACED, 0.01, 2.0);
        let [out, inside] =
            [0.02, -0.02].map(|offset| likelihood.cost(&candidate(offset, 0.0, 0.0)));
        assert!((out - inside).abs() < 1e-6, "{out} and {inside}");
        let tilted = likelihood.cost(&candidate(0.02, 1.0, 0.1));
        assert!((tilted - 2.0).abs() < 1e-3, "the typical misalignment: {tilted}");
    }
}
