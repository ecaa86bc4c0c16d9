//! Configuration files (`--config`): any part of the `c4d.toml` that a run folder records.
//!
//! A flag of the command line wins over the file, the file over the preset. Keys that describe the
//! inputs and results of a run (paths, fingerprints, version, device) are accepted and ignored, so
//! that the record of a run is a valid configuration.

mod motion;
mod refinement;

pub(crate) use motion::{AnchorSettings, KnnSettings, TransportSettings};
pub(crate) use refinement::{
    AdamSettings, EvidenceSettings, OcclusionSettings, RefineSettings, RegressionSettings,
};

use crate::args::{
    AxesArg, BaselineArg, FollowArg, Global, MotionArg, PresetArg, PropagateArgs, RefineFlags,
};
use crate::failure::{Failure, Outcome};
use amg::{MotionGuide, MotionOptions, MotionParams};
use clap::ValueEnum;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A configuration file; missing keys have the preset's values.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Settings {
    version: Option<String>,
    source: Option<PathBuf>,
    source_from_run: Option<PathBuf>,
    source_sha256: Option<String>,
    edited: Option<PathBuf>,
    edited_sha256: Option<String>,
    edit_time: Option<f32>,
    axes: Option<String>,
    align: Option<bool>,
    keep_rest: Option<bool>,
    allow_far: Option<bool>,
    preset: Option<String>,
    baseline: Option<String>,
    motion: Option<String>,
    follow: Option<String>,
    seed: Option<u64>,
    iteration: Option<u64>,
    set: Option<Vec<String>>,
    position: Option<String>,
    rotation: Option<String>,
    scale: Option<String>,
    appearance: Option<bool>,
    /// Result of a run, ignored.
    rotation_prior: Option<f32>,
    fading: Option<bool>,
    anchors: Option<AnchorSettings>,
    transport: Option<TransportSettings>,
    knn: Option<KnnSettings>,
    /// Parameters of the default guide.
    regions: Option<MotionParams>,
    refine: Option<RefineSettings>,
    /// Path of the file, for messages.
    #[serde(skip)]
    path: PathBuf,
}

/// Options of `c4d propagate`: flags, configuration and preset combined.
#[derive(Debug, Clone)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "flags of a command line are independent switches"
)]
pub(crate) struct PropagateJob {
    pub(crate) scene: PathBuf,
    pub(crate) edited: PathBuf,
    pub(crate) output: PathBuf,
    pub(crate) time: f32,
    pub(crate) axes: Option<AxesArg>,
    pub(crate) no_refine: bool,
    pub(crate) preset: PresetArg,
    pub(crate) baseline: Option<BaselineArg>,
    pub(crate) motion: MotionArg,
    /// `None`: chosen by the lifetimes of the scene's splats.
    pub(crate) follow: Option<FollowArg>,
    pub(crate) seed: u64,
    pub(crate) allow_far: bool,
    pub(crate) dry_run: bool,
    pub(crate) align: bool,
    pub(crate) keep_rest: bool,
    pub(crate) refine: RefineFlags,
    pub(crate) settings: Settings,
}

impl Settings {
    /// Reads a file; an empty configuration without one.
    pub(crate) fn read(path: Option<&Path>) -> Outcome<Self> {
        let Some(path) = path else { return Ok(Self::default()) };
        let failure = |what: String| {
            Failure::bad_input(format!("{}: {what}", path.display())).next(
                "Any part of the c4d.toml of a run folder is a configuration; docs/CONFIGURATION.md lists the keys.",
            )
        };
        let bytes = std::fs::read(path).map_err(|error| {
            Failure::bad_input(format!("cannot read {}: {error}", path.display()))
                .next("Check that the name is right and that the file is readable.")
        })?;
        let text = String::from_utf8(bytes).map_err(|error| failure(error.to_string()))?;
        let settings: Self =
            toml::from_str(&text).map_err(|error| failure(error.to_string().trim().to_owned()))?;
        Ok(Self { path: path.to_owned(), ..settings })
    }

    /// Options of the refinement stage.
    pub(crate) fn refine(&self) -> RefineSettings {
        self.refine.clone().unwrap_or_default().read_from(&self.path)
    }

    /// Whether this is the record of a run without refinement, which is repeated without it.
    fn records_no_refinement(&self) -> bool {
        self.source_sha256.is_some() && self.refine.is_none()
    }

    /// The flags of model folders, completed from the file.
    pub(crate) fn global(&self, global: &Global) -> Global {
        let set = match &self.set {
            Some(set) if global.set.is_empty() => set.clone(),
            _ => global.set.clone(),
        };
        Global { iteration: global.iteration.or(self.iteration), set, ..global.clone() }
    }

    fn wrong<T>(&self, key: &str, found: &str, expected: &str) -> Outcome<T> {
        Err(Failure::bad_input(format!(
            "{}: `{key}` is \"{found}\", expected {expected}",
            self.path.display()
        )))
    }

    /// Combines flags, file and preset.
    pub(crate) fn job(self, args: &PropagateArgs) -> Outcome<PropagateJob> {
        let preset = match (args.preset, self.preset.as_deref()) {
            (Some(preset), _) => preset,
            (None, Some("paper")) => PresetArg::Paper,
            (None, Some("default" | "best") | None) => PresetArg::Default,
            (None, Some(other)) => return self.wrong("preset", other, "default or paper"),
        };
        let baseline = match (args.baseline, self.baseline.as_deref()) {
            (Some(baseline), _) => Some(baseline),
            (None, Some("knn")) => Some(BaselineArg::Knn),
            (None, Some("deformnet")) => Some(BaselineArg::Deformnet),
            (None, Some("none") | None) => None,
            (None, Some(other)) => {
                return self.wrong("baseline", other, "none, knn or deformnet");
            }
        };
        let motion = match (args.motion, self.motion.as_deref()) {
            (Some(motion), _) => motion,
            (None, Some("edited" | "amg")) => MotionArg::Edited,
            (None, Some("all" | "amg-all")) => MotionArg::All,
            (None, Some(other)) => return self.wrong("motion", other, "edited or all"),
            // the paper estimates every splat
            (None, None) if preset == PresetArg::Paper && baseline.is_none() => MotionArg::All,
            (None, None) => MotionArg::Edited,
        };
        let follow = match (args.follow, self.follow.as_deref()) {
            (Some(follow), _) => Some(follow),
            (None, Some("splats")) => Some(FollowArg::Splats),
            (None, Some("surface")) => Some(FollowArg::Surface),
            (None, Some(other)) => return self.wrong("follow", other, "splats or surface"),
            (None, None) => None,
        };
        let axes = match self.axes.as_deref().map(|name| AxesArg::from_str(name, false)) {
            Some(Err(_)) => {
                let found = self.axes.as_deref().unwrap_or_default();
                return self.wrong("axes", found, "ply, rub or luf");
            }
            Some(Ok(axes)) => Some(axes),
            None => None,
        };
        if let Some(time) = self.edit_time.filter(|time| !time.is_finite()) {
            return self.wrong("edit_time", &time.to_string(), "a finite time");
        }
        Ok(PropagateJob {
            scene: args.scene.clone(),
            edited: args.edited.clone(),
            output: args.output.clone(),
            time: args.time.or(self.edit_time).unwrap_or(0.0),
            axes: args.axes.or(axes),
            no_refine: args.no_refine || self.records_no_refinement(),
            preset,
            baseline,
            motion,
            follow,
            seed: args.seed.or(self.seed).unwrap_or(0),
            allow_far: args.allow_far || self.allow_far == Some(true),
            dry_run: args.dry_run,
            align: args.align || self.align == Some(true),
            keep_rest: args.keep_rest || self.keep_rest == Some(true),
            refine: self.refine().flags(&args.refine)?,
            settings: self,
        })
    }

    /// Sets the options given in the file.
    pub(crate) fn apply(&self, options: &mut MotionOptions) -> Outcome {
        let unused = |section: &str, applies: &str| {
            Err(Failure::bad_input(format!(
                "{}: [{section}] applies to {applies} only",
                self.path.display()
            ))
            .next(format!("Omit [{section}], or choose {applies}.")))
        };
        match (&mut options.guide, &self.anchors, &self.transport) {
            (MotionGuide::Paper(params), anchors, transport) => {
                if let Some(anchors) = anchors {
                    anchors.apply(params, &self.path)?;
                }
                if let Some(transport) = transport {
                    transport.apply(params);
                }
            }
            (_, Some(_), _) => return unused("anchors", "--preset paper"),
            (_, _, Some(_)) => return unused("transport", "--preset paper"),
            _ => {}
        }
        match (&mut options.guide, &self.knn) {
            (MotionGuide::Knn(params), Some(knn)) => knn.apply(params),
            (_, Some(_)) => return unused("knn", "--baseline knn"),
            _ => {}
        }
        match (&mut options.guide, &self.regions) {
            (MotionGuide::Regions(params), Some(regions)) => params.clone_from(regions),
            (_, Some(_)) => return unused("regions", "--preset default"),
            _ => {}
        }
        self.apply_aggregation(&mut options.aggregation)
    }

    fn apply_aggregation(&self, aggregation: &mut amg::Aggregation) -> Outcome {
        let names = [
            ("position", &self.position, "average or rigid"),
            ("rotation", &self.rotation, "additive or relative"),
            ("scale", &self.scale, "per-axis or isotropic"),
        ];
        for (key, value, expected) in names {
            let Some(value) = value else { continue };
            let known = match (key, value.as_str()) {
                ("position", "average") => {
                    aggregation.position = amg::PositionRule::Average;
                    true
                }
                ("position", "rigid") => {
                    aggregation.position = amg::PositionRule::Rigid;
                    true
                }
                ("rotation", "additive") => {
                    aggregation.rotation = amg::RotationRule::Additive;
                    true
                }
                ("rotation", "relative") => {
                    aggregation.rotation = amg::RotationRule::Relative;
                    true
                }
                ("scale", "per-axis") => {
                    aggregation.scale = amg::ScaleRule::PerAxis;
                    true
                }
                ("scale", "isotropic") => {
                    aggregation.scale = amg::ScaleRule::Isotropic;
                    true
                }
                _ => false,
            };
            if !known {
                return self.wrong(key, value, expected);
            }
        }
        aggregation.appearance = self.appearance.unwrap_or(aggregation.appearance);
        aggregation.fading = self.fading.unwrap_or(aggregation.fading);
        Ok(())
    }
}
