//! The section `[refine]`: options of the appearance refinement.

use crate::args::{PresetArg, RefineFlags, Up, WarpArg};
use crate::failure::{Failure, Outcome, chain};
use clap::ValueEnum;
use cuar::{
    AdamParams, CuarError, EvidenceParams, RefineOptions, RegressionParams, Solver, WarpParams,
};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Options of the refinement. `device` is a recorded result of a run and is ignored.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct RefineSettings {
    preset: Option<String>,
    warp: Option<String>,
    cameras: Option<String>,
    size: Option<[u32; 2]>,
    up: Option<String>,
    frames: Option<usize>,
    samples: Option<usize>,
    memory: Option<usize>,
    epsilon: Option<f32>,
    min_uncertainty: Option<f32>,
    eta: Option<f64>,
    zeta: Option<f64>,
    keep_first_frame: Option<bool>,
    seed: Option<u64>,
    device: Option<String>,
    adam: Option<AdamSettings>,
    regression: Option<RegressionSettings>,
    occlusion: Option<OcclusionSettings>,
    evidence: Option<EvidenceSettings>,
    /// Path of the file, for messages.
    #[serde(skip)]
    path: PathBuf,
}

/// Equality of the options, regardless of `path`.
impl PartialEq for RefineSettings {
    fn eq(&self, other: &Self) -> bool {
        let values = |settings: &Self| serde_json::to_value(settings).ok();
        values(self) == values(other)
    }
}

/// `[refine.adam]`: minimise by Adam.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct AdamSettings {
    steps: Option<usize>,
    rate_dc: Option<f32>,
    rate_rest: Option<f32>,
}

/// `[refine.regression]`: minimise by weighted least squares.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct RegressionSettings {
    passes: Option<usize>,
    delta: Option<f64>,
    relaxation: Option<f64>,
    #[serde(alias = "hold")]
    anchor_weight: Option<f64>,
    prior: Option<f64>,
}

/// `[refine.occlusion]`: selection of the pixels that frame 1 supervises.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct OcclusionSettings {
    min_coverage: Option<f32>,
    depth_tolerance: Option<f32>,
    spread_tolerance: Option<f32>,
    min_facing: Option<f32>,
    slack: Option<f32>,
    /// Supervise every masked pixel, regardless of `slack`.
    supervise_all: Option<bool>,
    min_known_color: Option<f32>,
    min_visible_share: Option<f32>,
}

/// `[refine.evidence]`: detection of splats that frame 1 does not supervise.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct EvidenceSettings {
    /// Whether to repair such splats.
    repair: Option<bool>,
    hidden: Option<f32>,
    supervised: Option<f32>,
    min_change: Option<f32>,
    hue_spread: Option<f32>,
    light_spread: Option<f32>,
    strain: Option<f64>,
    min_agreement: Option<f32>,
}

impl RefineSettings {
    /// Preset of the section.
    pub(crate) fn preset(&self) -> Outcome<Option<PresetArg>> {
        match self.preset.as_deref() {
            None => Ok(None),
            Some("default" | "best") => Ok(Some(PresetArg::Default)),
            Some("paper") => Ok(Some(PresetArg::Paper)),
            Some(other) => self.wrong("preset", other, "default or paper"),
        }
    }

    /// The same settings, read from `path`.
    pub(super) fn read_from(self, path: &Path) -> Self {
        Self { path: path.to_owned(), ..self }
    }

    /// Failure for a value out of range.
    pub(crate) fn refused(&self, error: &CuarError) -> Failure {
        Failure::bad_input(format!("{}: [refine]: {}", self.path.display(), chain(error)))
    }

    fn wrong<T>(&self, key: &str, found: &str, expected: &str) -> Outcome<T> {
        Err(Failure::bad_input(format!(
            "{}: `{key}` in [refine] is {found}, expected {expected}",
            self.path.display()
        )))
    }

    /// Seed of the section.
    pub(crate) fn seed(&self) -> Option<u64> {
        self.seed
    }

    /// The flags, with missing ones filled in from the section.
    pub(crate) fn flags(&self, flags: &RefineFlags) -> Outcome<RefineFlags> {
        let mut flags = flags.clone();
        if flags.refine_cameras.is_none() {
            flags.refine_cameras =
                self.cameras.as_deref().filter(|name| *name != "rig").map(PathBuf::from);
        }
        if let Some([width, height]) = self.size {
            if !(1..=16_384).contains(&width) || !(1..=16_384).contains(&height) {
                let found = format!("[{width}, {height}]");
                return self.wrong("size", &found, "1 to 16384 pixels each");
            }
            flags.refine_size = flags.refine_size.or(Some((width, height)));
        }
        if let Some(name) = &self.up {
            let up = Up::from_str(name, false);
            let Ok(up) = up else { return self.wrong("up", name, "x, y, z, -x, -y or -z") };
            flags.refine_up = flags.refine_up.or(Some(up));
        }
        if let Some(name) = &self.warp {
            let warp = WarpArg::from_str(name, false);
            let Ok(warp) = warp else { return self.wrong("warp", name, "backward or paper") };
            flags.warp = flags.warp.or(Some(warp));
        }
        flags.refine_frames = flags.refine_frames.or(self.frames);
        flags.samples = flags.samples.or(self.samples);
        flags.memory = flags.memory.or(self.memory);
        flags.epsilon = flags.epsilon.or(self.epsilon);
        Ok(flags)
    }

    /// Applies the options that have no flag.
    pub(crate) fn apply(&self, options: &mut RefineOptions) -> Outcome {
        options.min_uncertainty = self.min_uncertainty.unwrap_or(options.min_uncertainty);
        options.weights.eta = self.eta.unwrap_or(options.weights.eta);
        options.weights.zeta = self.zeta.unwrap_or(options.weights.zeta);
        options.keep_first_frame = self.keep_first_frame.unwrap_or(options.keep_first_frame);
        match (&self.adam, &self.regression) {
            (Some(_), Some(_)) => {
                return Err(Failure::bad_input(format!(
                    "{}: [refine.adam] and [refine.regression] are both given",
                    self.path.display()
                ))
                .next("Keep the section of the minimiser to use."));
            }
            (Some(adam), None) => {
                let params = match &options.solver {
                    Solver::Adam(params) => params.clone(),
                    Solver::Regression(_) => AdamParams::default(),
                };
                options.solver = Solver::Adam(adam.over(&params));
            }
            (None, Some(regression)) => {
                let params = match &options.solver {
                    Solver::Regression(params) => params.clone(),
                    Solver::Adam(_) => RegressionParams::default(),
                };
                options.solver = Solver::Regression(regression.over(&params));
            }
            (None, None) => {}
        }
        if let Some(occlusion) = &self.occlusion {
            occlusion.apply(&mut options.warp_params);
        }
        if let Some(evidence) = &self.evidence {
            options.evidence = evidence.over(options.evidence.as_ref());
        }
        Ok(())
    }
}

impl AdamSettings {
    /// All values of a run.
    pub(crate) fn of(params: &AdamParams) -> Self {
        Self {
            steps: Some(params.steps),
            rate_dc: Some(params.rate_dc),
            rate_rest: Some(params.rate_rest),
        }
    }

    fn over(&self, params: &AdamParams) -> AdamParams {
        AdamParams {
            steps: self.steps.unwrap_or(params.steps),
            rate_dc: self.rate_dc.unwrap_or(params.rate_dc),
            rate_rest: self.rate_rest.unwrap_or(params.rate_rest),
        }
    }
}

impl RegressionSettings {
    /// All values of a run.
    pub(crate) fn of(params: &RegressionParams) -> Self {
        Self {
            passes: Some(params.passes),
            delta: Some(params.delta),
            relaxation: Some(params.relaxation),
            anchor_weight: Some(params.anchor_weight),
            prior: Some(params.prior),
        }
    }

    fn over(&self, params: &RegressionParams) -> RegressionParams {
        RegressionParams {
            passes: self.passes.unwrap_or(params.passes),
            delta: self.delta.unwrap_or(params.delta),
            relaxation: self.relaxation.unwrap_or(params.relaxation),
            anchor_weight: self.anchor_weight.unwrap_or(params.anchor_weight),
            prior: self.prior.unwrap_or(params.prior),
        }
    }
}

impl OcclusionSettings {
    /// All values of a run.
    pub(crate) fn of(params: &WarpParams) -> Self {
        Self {
            min_coverage: Some(params.min_coverage),
            depth_tolerance: Some(params.depth_tolerance),
            spread_tolerance: Some(params.spread_tolerance),
            min_facing: Some(params.min_facing),
            slack: params.slack,
            supervise_all: Some(params.slack.is_none()),
            min_known_color: Some(params.min_known_color),
            min_visible_share: Some(params.min_visible_share),
        }
    }

    fn apply(&self, params: &mut WarpParams) {
        params.min_coverage = self.min_coverage.unwrap_or(params.min_coverage);
        params.depth_tolerance = self.depth_tolerance.unwrap_or(params.depth_tolerance);
        params.spread_tolerance = self.spread_tolerance.unwrap_or(params.spread_tolerance);
        params.min_facing = self.min_facing.unwrap_or(params.min_facing);
        if self.supervise_all == Some(true) {
            params.slack = None;
        } else if self.slack.is_some() {
            params.slack = self.slack;
        }
        params.min_known_color = self.min_known_color.unwrap_or(params.min_known_color);
        params.min_visible_share = self.min_visible_share.unwrap_or(params.min_visible_share);
    }
}

impl EvidenceSettings {
    /// All values of a run.
    pub(crate) fn of(params: Option<&EvidenceParams>) -> Self {
        let Some(params) = params else { return Self { repair: Some(false), ..Self::default() } };
        Self {
            repair: Some(true),
            hidden: Some(params.hidden),
            supervised: Some(params.supervised),
            min_change: Some(params.min_change),
            hue_spread: Some(params.hue_spread),
            light_spread: Some(params.light_spread),
            strain: Some(params.strain),
            min_agreement: Some(params.min_agreement),
        }
    }

    /// `params` with these values; `None` if the repair is disabled.
    pub(crate) fn over(&self, params: Option<&EvidenceParams>) -> Option<EvidenceParams> {
        if !self.repair.unwrap_or(params.is_some()) {
            return None;
        }
        let params = params.copied().unwrap_or_default();
        Some(EvidenceParams {
            hidden: self.hidden.unwrap_or(params.hidden),
            supervised: self.supervised.unwrap_or(params.supervised),
            min_change: self.min_change.unwrap_or(params.min_change),
            hue_spread: self.hue_spread.unwrap_or(params.hue_spread),
            light_spread: self.light_spread.unwrap_or(params.light_spread),
            strain: self.strain.unwrap_or(params.strain),
            min_agreement: self.min_agreement.unwrap_or(params.min_agreement),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    #[test]
    fn former_names_are_read() {
        let former: RefineSettings =
            toml::from_str("preset = \"best\"\n[regression]\nhold = 2.0").unwrap();
        assert_eq!(former.preset().unwrap(), Some(PresetArg::Default), "preset in a file");
        let regression = former.regression.unwrap_or_default();
        assert_eq!(regression.anchor_weight, Some(2.0), "`hold`");
        assert_eq!(PresetArg::from_str("best", false), Ok(PresetArg::Default), "preset as a flag");
        let stored: PresetArg = serde_json::from_str("\"Best\"").unwrap();
        assert_eq!(stored, PresetArg::Default, "preset in a checkpoint");
    }
}
