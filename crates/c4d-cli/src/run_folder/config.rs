//! `c4d.toml`: the resolved configuration of a run.

use crate::passes::Mask;
use crate::settings::{
    AdamSettings, AnchorSettings, EvidenceSettings, KnnSettings, OcclusionSettings,
    RegressionSettings, TransportSettings,
};
use amg::{Aggregation, PositionRule, RotationRule, ScaleRule};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The resolved configuration, `c4d.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "options are named as on the command line")]
pub(crate) struct RunConfig {
    /// Version of c4d that wrote it.
    pub(crate) version: String,
    /// Source scene, absolute.
    pub(crate) source: PathBuf,
    /// Source scene relative to the run folder; tried first, so that both may be moved together.
    pub(crate) source_from_run: PathBuf,
    /// Fingerprint of the source.
    pub(crate) source_sha256: String,
    /// Edited PLY as given.
    pub(crate) edited: PathBuf,
    /// Fingerprint of the edited PLY.
    pub(crate) edited_sha256: String,
    /// Time of the edited frame.
    pub(crate) edit_time: f32,
    /// Axes of the edited frame, if they were given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) axes: Option<String>,
    /// Whether a placement of the whole edit was undone.
    #[serde(default)]
    pub(crate) align: bool,
    /// Whether splats missing from the edit were added.
    #[serde(default)]
    pub(crate) keep_rest: bool,
    /// Whether an edit that seems to belong to a different scene was accepted.
    #[serde(default)]
    pub(crate) allow_far: bool,
    /// `default` or `paper`.
    pub(crate) preset: String,
    /// `none`, `knn` or `deformnet`.
    pub(crate) baseline: String,
    /// `edited` or `all`; `amg` or `amg-all` in earlier runs.
    pub(crate) motion: String,
    /// `splats` or `surface`.
    #[serde(default = "splats")]
    pub(crate) follow: String,
    /// Random seed.
    pub(crate) seed: u64,
    /// Model folders: requested iteration.
    pub(crate) iteration: Option<u64>,
    /// Model folders: flags overridden.
    pub(crate) set: Vec<String>,
    /// Rule for positions of blended rows.
    pub(crate) position: String,
    /// Rule for rotations.
    pub(crate) rotation: String,
    /// Rule for scales.
    pub(crate) scale: String,
    /// Whether blended rows follow the source's change of opacity and colour.
    pub(crate) appearance: bool,
    /// Weight of the source's rotations in local rigid motions.
    pub(crate) rotation_prior: f32,
    /// Whether faint source splats have less weight.
    #[serde(default)]
    pub(crate) fading: bool,
    /// Anchors, if they were used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) anchors: Option<AnchorSettings>,
    /// Transport, if it was used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) transport: Option<TransportSettings>,
    /// Baseline `knn`, if it was used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) knn: Option<KnnSettings>,
    /// Parameters of the default guide, if it was used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) regions: Option<amg::MotionParams>,
    /// Appearance refinement, if it ran.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) refine: Option<RefineConfig>,
}

/// Options of the refinement stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct RefineConfig {
    /// `default` or `paper`.
    pub(crate) preset: String,
    /// `backward` or `paper`.
    pub(crate) warp: String,
    /// Cameras: a file, or `rig`.
    pub(crate) cameras: String,
    /// Requested image size, pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) size: Option<[u32; 2]>,
    /// Requested upward direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) up: Option<String>,
    /// Candidate times.
    pub(crate) frames: usize,
    /// Number of sampled images.
    pub(crate) samples: usize,
    /// Memory for images, MiB.
    #[serde(default)]
    pub(crate) memory: usize,
    /// ε of Eq. 17.
    pub(crate) epsilon: f32,
    /// Uncertainty below which no pixel is an artifact.
    #[serde(default = "usual_floor")]
    pub(crate) min_uncertainty: f32,
    /// η of Eq. 18.
    #[serde(default)]
    pub(crate) eta: Option<f64>,
    /// ζ of Eq. 20.
    #[serde(default)]
    pub(crate) zeta: Option<f64>,
    /// Whether the edited frame was among the images.
    #[serde(default)]
    pub(crate) keep_first_frame: Option<bool>,
    /// Seed of the sampling.
    pub(crate) seed: u64,
    /// Device that rendered.
    pub(crate) device: String,
    /// Minimiser, if it was Adam.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) adam: Option<AdamSettings>,
    /// Minimiser, if it was least squares.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) regression: Option<RegressionSettings>,
    /// Parameters of the pixels supervised by frame 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) occlusion: Option<OcclusionSettings>,
    /// Parameters for finding splats not supervised by frame 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) evidence: Option<EvidenceSettings>,
}

/// Value of `follow` for runs written before `--follow surface` existed.
fn splats() -> String {
    "splats".to_owned()
}

fn usual_floor() -> f32 {
    Mask::default().min_uncertainty
}

impl RefineConfig {
    /// Parameters of the artifact mask.
    pub(crate) fn mask(&self) -> Mask {
        let usual = Mask::default().evidence;
        let evidence = match &self.evidence {
            Some(settings) => settings.over(usual.as_ref()),
            None => usual,
        };
        Mask { epsilon: self.epsilon, min_uncertainty: self.min_uncertainty, evidence }
    }
}

impl RunConfig {
    /// Refuses numbers that are not finite.
    pub(crate) fn check(&self) -> Result<(), String> {
        let finite = |name: &str, value: f32| {
            if value.is_finite() {
                return Ok(());
            }
            Err(format!("{name} = {value}: expected a finite number"))
        };
        finite("edit_time", self.edit_time)?;
        finite("rotation_prior", self.rotation_prior)?;
        if let Some(refine) = &self.refine {
            finite("refine.epsilon", refine.epsilon)?;
            finite("refine.min_uncertainty", refine.min_uncertainty)?;
        }
        Ok(())
    }

    /// Records how blended rows are evaluated.
    pub(crate) fn set_aggregation(&mut self, aggregation: Aggregation) {
        let names = (
            match aggregation.position {
                PositionRule::Average => "average",
                PositionRule::Rigid => "rigid",
            },
            match aggregation.rotation {
                RotationRule::Additive => "additive",
                RotationRule::Relative => "relative",
            },
            match aggregation.scale {
                ScaleRule::PerAxis => "per-axis",
                ScaleRule::Isotropic => "isotropic",
            },
        );
        names.0.clone_into(&mut self.position);
        names.1.clone_into(&mut self.rotation);
        names.2.clone_into(&mut self.scale);
        self.appearance = aggregation.appearance;
        self.rotation_prior = aggregation.rotation_prior;
        self.fading = aggregation.fading;
    }

    /// How blended rows are evaluated.
    pub(crate) fn aggregation(&self) -> Result<Aggregation, String> {
        let unknown = |name: &str, value: &str| Err(format!("{name} = \"{value}\" is unknown"));
        Ok(Aggregation {
            position: match self.position.as_str() {
                "average" => PositionRule::Average,
                "rigid" => PositionRule::Rigid,
                other => return unknown("position", other),
            },
            rotation: match self.rotation.as_str() {
                "additive" => RotationRule::Additive,
                "relative" => RotationRule::Relative,
                other => return unknown("rotation", other),
            },
            scale: match self.scale.as_str() {
                "per-axis" => ScaleRule::PerAxis,
                "isotropic" => ScaleRule::Isotropic,
                other => return unknown("scale", other),
            },
            appearance: self.appearance,
            rotation_prior: self.rotation_prior,
            fading: self.fading,
        })
    }
}
