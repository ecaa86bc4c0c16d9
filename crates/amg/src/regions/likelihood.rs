//! Negative log-likelihood, in nats, that an edited splat belongs to a region.

use super::candidates::Candidate;
use super::numeric::TINY;
use gs_core::Real;

/// Scale of the Welsch cost of the offset (Eq. 21), in variances. Half of it is the maximum cost of
/// an offset.
const WELSCH: f64 = 12.0;

/// Standard deviation of offsets on an undisplaced surface, as a share of the spacing: discs
/// approximate a surface only roughly.
const ROUGHNESS: f64 = 0.1;

/// Statistics of the edited splats of one region.
#[derive(Debug, Clone, Copy)]
pub(super) struct Statistics {
    /// Mean signed offset along the outward normal, world units.
    pub(super) mean: f64,
    /// Its standard deviation, world units.
    pub(super) sigma: f64,
    /// Mean `1 − |cos|` between normals.
    pub(super) misalignment: f64,
    /// Mean squared difference of flatness.
    pub(super) flatness_gap: f64,
}

/// Cost function of one region: the mean offset, and the inverse of each scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct Likelihood {
    mean: f32,
    inverse_offset: f32,
    inverse_tangent: f32,
    inverse_misalignment: f32,
    inverse_flatness_gap: f32,
}

impl Likelihood {
    /// `spacing` of the regions, world units; `alignment`, the cost of the typical misalignment.
    pub(super) fn of(statistics: &Statistics, spacing: f64, alignment: f64) -> Self {
        let Statistics { mean, sigma, misalignment, flatness_gap } = *statistics;
        let across = (sigma * sigma + (ROUGHNESS * spacing).powi(2)).max(TINY * TINY);
        // Along the surface, a region extends to its neighbours, and farther if the edit displaced
        // it.
        let along = spacing * spacing + across + mean * mean;
        Self {
            mean: mean.as_f32(),
            inverse_offset: across.recip().as_f32(),
            inverse_tangent: along.recip().as_f32(),
            inverse_misalignment: (alignment / misalignment).as_f32(),
            inverse_flatness_gap: flatness_gap.recip().as_f32(),
        }
    }

    /// Half the sum of squared offset, squared tangential distance and squared difference of
    /// flatness, each over its variance, plus the misalignment over its mean. The cost of the
    /// offset is robust; its sign counts only to the degree to which both are flat, because a ball
    /// has no outward side.
    pub(super) fn cost(&self, of: &Candidate) -> f32 {
        let welsch = WELSCH.as_f32();
        let across = (of.offset - self.mean).powi(2) * self.inverse_offset;
        let across = welsch * (1.0 - (-across / welsch).exp());
        let ball = of.offset * of.offset * self.inverse_tangent;
        let along = of.tangent_squared * self.inverse_tangent;
        let flatness_gap = of.flatness_gap * self.inverse_flatness_gap;
        0.5 * (of.flatness * across + (1.0 - of.flatness) * ball + along + flatness_gap)
            + self.inverse_misalignment * of.misalignment
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DISPLACED: Statistics =
        Statistics { mean: 0.02, sigma: 0.003, misalignment: 0.1, flatness_gap: 0.1 };

    fn candidate(offset: f32, flatness: f32, misalignment: f32) -> Candidate {
        Candidate {
            region: 0,
            hypothesis: 0,
            offset,
            tangent_squared: 0.0,
            flatness,
            misalignment,
            flatness_gap: 0.0,
        }
    }

    #[test]
    fn splats_on_the_displaced_surface_have_the_lowest_cost() {
        let likelihood = Likelihood::of(&DISPLACED, 0.01, 2.0);
        let [displaced, on_surface, inside] =
            [0.02, 0.0, -0.02].map(|offset| likelihood.cost(&candidate(offset, 1.0, 0.0)));
        assert!(
            displaced < 1e-6 && displaced + 4.0 < on_surface && on_surface <= inside,
            "{displaced} {on_surface} {inside}"
        );
        assert!(inside <= 0.5 * 12.0, "the Welsch cost is bounded: {inside}");
    }

    #[test]
    fn offsets_of_balls_are_unsigned_and_typical_misalignment_has_the_given_cost() {
        let likelihood = Likelihood::of(&DISPLACED, 0.01, 2.0);
        let [out, inside] =
            [0.02, -0.02].map(|offset| likelihood.cost(&candidate(offset, 0.0, 0.0)));
        assert!((out - inside).abs() < 1e-6, "{out} and {inside}");
        let tilted = likelihood.cost(&candidate(0.02, 1.0, 0.1));
        assert!((tilted - 2.0).abs() < 1e-3, "the typical misalignment: {tilted}");
    }
}
