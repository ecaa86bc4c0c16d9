//! Sections of the motion stage: `[anchors]`, `[transport]`, `[knn]`.

use crate::failure::{Failure, Outcome};
use amg::{AnchorSampling, Grouping, KnnParams, PaperParams, Radius};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Anchors of `--preset paper` (Eqs. 5–7).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct AnchorSettings {
    /// `lines` or `farthest-points`.
    sampling: Option<String>,
    /// Number of nearest neighbours connected to a splat.
    k: Option<usize>,
    /// `disjoint` or `overlapping`.
    grouping: Option<String>,
    /// Largest mean edge of a disjoint neighbourhood, medians.
    max_edge_ratio: Option<f64>,
    /// Rule for δ: `global`, `local`, or `fixed` with `radius`.
    radius_rule: Option<String>,
    /// δ of the rule `fixed`, world units.
    radius: Option<f64>,
    /// δ over the mean member distance, for the other rules.
    radius_factor: Option<f64>,
    /// Lines (rays).
    num_lines: Option<usize>,
}

/// Transport of `--preset paper` (Eqs. 21, 22).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct TransportSettings {
    /// γ, width of the cost over the median anchor distance.
    gamma: Option<f64>,
    /// λ0.
    lambda_ent: Option<f64>,
    /// λ1.
    lambda_a: Option<f64>,
    /// λ2.
    lambda_b: Option<f64>,
    /// Distance in β from which the cost is 1.
    cutoff: Option<f64>,
    /// Largest last change of a potential, λ0.
    tol: Option<f64>,
    /// Largest number of sweeps.
    max_sweeps: Option<usize>,
}

/// `--baseline knn`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct KnnSettings {
    /// Number of averaged source splats.
    k: Option<usize>,
}

impl AnchorSettings {
    /// All values of a run.
    pub(crate) fn of(params: &PaperParams) -> Self {
        let anchors = &params.anchors;
        let (rule, radius) = match anchors.radius {
            Radius::Global => ("global", None),
            Radius::Local => ("local", None),
            Radius::Fixed(radius) => ("fixed", Some(radius)),
        };
        let sampling = match params.sampling {
            AnchorSampling::Lines => "lines",
            AnchorSampling::FarthestPoints => "farthest-points",
        };
        let grouping = match anchors.grouping {
            Grouping::Disjoint => "disjoint",
            Grouping::Overlapping => "overlapping",
        };
        Self {
            sampling: Some(sampling.to_owned()),
            k: Some(anchors.k),
            grouping: Some(grouping.to_owned()),
            max_edge_ratio: Some(anchors.max_edge_ratio),
            radius_rule: Some(rule.to_owned()),
            radius,
            radius_factor: Some(anchors.radius_factor),
            num_lines: Some(anchors.num_lines),
        }
    }

    pub(super) fn apply(&self, params: &mut PaperParams, path: &Path) -> Outcome {
        let wrong = |key: &str, found: &str, expected: &str| {
            Err(Failure::bad_input(format!(
                "{}: `{key}` in [anchors] is {found}, expected {expected}",
                path.display()
            )))
        };
        params.sampling = match self.sampling.as_deref() {
            None => params.sampling,
            Some("lines") => AnchorSampling::Lines,
            Some("farthest-points") => AnchorSampling::FarthestPoints,
            Some(other) => return wrong("sampling", other, "lines or farthest-points"),
        };
        let anchors = &mut params.anchors;
        anchors.grouping = match self.grouping.as_deref() {
            None => anchors.grouping,
            Some("disjoint") => Grouping::Disjoint,
            Some("overlapping") => Grouping::Overlapping,
            Some(other) => return wrong("grouping", other, "disjoint or overlapping"),
        };
        anchors.radius = match (self.radius_rule.as_deref(), self.radius) {
            (None, None) => anchors.radius,
            (Some("global"), None) => Radius::Global,
            (Some("local"), None) => Radius::Local,
            (None | Some("fixed"), Some(radius)) => Radius::Fixed(radius),
            (Some("fixed"), None) => return wrong("radius", "missing", "δ in world units"),
            (Some("global" | "local"), Some(radius)) => {
                return wrong("radius", &radius.to_string(), "no radius with this radius_rule");
            }
            (Some(other), _) => return wrong("radius_rule", other, "global, local or fixed"),
        };
        anchors.k = self.k.unwrap_or(anchors.k);
        anchors.max_edge_ratio = self.max_edge_ratio.unwrap_or(anchors.max_edge_ratio);
        anchors.radius_factor = self.radius_factor.unwrap_or(anchors.radius_factor);
        anchors.num_lines = self.num_lines.unwrap_or(anchors.num_lines);
        Ok(())
    }
}

impl TransportSettings {
    /// All values of a run.
    pub(crate) fn of(params: &PaperParams) -> Self {
        let [lambda_ent, lambda_a, lambda_b] = params.lambdas.map(Some);
        Self {
            gamma: Some(params.gamma),
            lambda_ent,
            lambda_a,
            lambda_b,
            cutoff: Some(params.cutoff),
            tol: Some(params.tol),
            max_sweeps: Some(params.max_sweeps),
        }
    }

    pub(super) fn apply(&self, params: &mut PaperParams) {
        params.gamma = self.gamma.unwrap_or(params.gamma);
        let given = [self.lambda_ent, self.lambda_a, self.lambda_b];
        for (lambda, given) in params.lambdas.iter_mut().zip(given) {
            *lambda = given.unwrap_or(*lambda);
        }
        params.cutoff = self.cutoff.unwrap_or(params.cutoff);
        params.tol = self.tol.unwrap_or(params.tol);
        params.max_sweeps = self.max_sweeps.unwrap_or(params.max_sweeps);
    }
}

impl KnnSettings {
    /// All values of a run.
    pub(crate) fn of(params: KnnParams) -> Self {
        Self { k: Some(params.k) }
    }

    pub(super) fn apply(&self, params: &mut KnnParams) {
        params.k = self.k.unwrap_or(params.k);
    }
}
