//! [`MotionParams`]: the parameters of the default motion model.

use crate::AmgError;
use serde::{Deserialize, Serialize};

/// Parameters of [`crate::MotionGuide::Regions`], with the symbols of `docs/MOTION.md`.
/// `docs/BENCHMARKS.md` has their measured sensitivity.
///
/// Lengths are shares of the figure's size, costs are nats (natural logarithms of probabilities).
/// In a configuration file these are the keys of one table; absent keys keep their defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionParams {
    /// Edge of the cubes in which splats that move together form a region; share of the figure.
    /// Default 0.015.
    pub region_size: f64,
    /// Largest relative change of the distance between two splats that still counts as moving
    /// together, for soft bodies. Default 0.04.
    pub strain: f64,
    /// Largest distance between the images of a splat under two motions that count as one; share
    /// of the figure. At least four times the noise of the trajectories. Default 0.015.
    pub same_motion: f64,
    /// λ₀, weight of the entropy in the transport of splats to regions, nats: 1 gives the
    /// probabilities of the likelihood, smaller values sharpen them. Default 0.5.
    pub entropy: f64,
    /// λ₁, weight of the source marginal of patches of regions, nats: near 0, any number of splats
    /// may belong to a patch. Default 2.
    pub source_marginal: f64,
    /// Cost of leaving a splat unmatched, nats. Default 4.
    pub unmatched: f64,
    /// Weight, in splats, of the prior that the edit displaced no surface. Default 0.03.
    pub prior: f64,
    /// Cost of the typical misalignment of normals, nats. Default 2.
    pub alignment: f64,
    /// Distance from every source beyond which geometry is new; share of the figure. A connected
    /// piece of which a third is beyond it moves with the part it is attached to. Default 0.06.
    pub new_geometry: f64,
    /// Largest number of source splats that determine the rigid motion of an edited splat, 1 to 64.
    /// Default 32.
    pub sources_per_row: usize,
}

impl Default for MotionParams {
    fn default() -> Self {
        Self {
            region_size: 0.015,
            strain: 0.04,
            same_motion: 0.015,
            entropy: 0.5,
            source_marginal: 2.0,
            unmatched: 4.0,
            prior: 0.03,
            alignment: 2.0,
            new_geometry: 0.06,
            sources_per_row: 32,
        }
    }
}

impl MotionParams {
    pub(crate) fn check(&self) -> Result<(), AmgError> {
        let positive = [
            ("regions.region_size", self.region_size),
            ("regions.strain", self.strain),
            ("regions.same_motion", self.same_motion),
            ("regions.entropy", self.entropy),
            ("regions.source_marginal", self.source_marginal),
            ("regions.prior", self.prior),
            ("regions.new_geometry", self.new_geometry),
        ];
        let not_negative =
            [("regions.unmatched", self.unmatched), ("regions.alignment", self.alignment)];
        let wrong = |name, found: String, expected| Err(AmgError::Option { name, found, expected });
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return wrong(name, value.to_string(), "finite, above 0");
            }
        }
        for (name, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return wrong(name, value.to_string(), "finite, at least 0");
            }
        }
        if !(1..=64).contains(&self.sources_per_row) {
            return wrong("regions.sources_per_row", self.sources_per_row.to_string(), "1 to 64");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_the_parameter_that_is_out_of_range() {
        assert!(MotionParams::default().check().is_ok(), "the default");
        let wrong = [
            (MotionParams { region_size: 0.0, ..Default::default() }, "regions.region_size"),
            (MotionParams { entropy: f64::NAN, ..Default::default() }, "regions.entropy"),
            (MotionParams { unmatched: -1.0, ..Default::default() }, "regions.unmatched"),
            (MotionParams { sources_per_row: 65, ..Default::default() }, "regions.sources_per_row"),
        ];
        for (params, expected) in wrong {
            let found = params.check();
            assert!(
                matches!(found, Err(AmgError::Option { name, .. }) if name == expected),
                "{expected}: {found:?}"
            );
        }
    }
}
