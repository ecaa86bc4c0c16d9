//! Options of [`crate::propagate()`].

use crate::AmgError;
use crate::field::FieldAt;
use crate::motion_params::MotionParams;
use gs_core::Precision;
use std::sync::Arc;

/// Named sets of options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MotionPreset {
    /// Regions of the source that move as one (default).
    Regions,
    /// The paper as printed.
    Paper,
    /// The paper's baseline "KNN-Guide", k = 3.
    Knn,
}

/// Method that finds correspondences between edited and source splats.
#[derive(Debug, Clone)]
pub enum MotionGuide {
    /// Regions that move as one, transport of edited splats to regions with learned offsets, rigid
    /// aggregation (`docs/MOTION.md`).
    Regions(MotionParams),
    /// Anchors, Sinkhorn, nearest matched anchor (Eqs. 5–10, 21–24).
    Paper(PaperParams),
    /// Average over the nearest source splats ("KNN-Guide").
    Knn(KnnParams),
    /// The source's own deformation field, evaluated at the edited positions ("DeformNet-Guide",
    /// "w/o AMG").
    Field(Arc<dyn FieldAt>),
}

/// Options of [`MotionGuide::Knn`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnnParams {
    /// Source splats averaged. Default 3 (main paper, ablation).
    pub k: usize,
}

impl Default for KnnParams {
    fn default() -> Self {
        Self { k: 3 }
    }
}

/// How [`MotionGuide::Paper`] samples anchors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AnchorSampling {
    /// Neighbourhoods that lines through the scene's sphere hit (Eqs. 5–7).
    #[default]
    Lines,
    /// Farthest-point sampling, the paper's "naive sampling": one anchor per `k + 1` splats, as
    /// many as there are neighbourhoods. Each represents the splats nearest to it.
    FarthestPoints,
}

/// Options of [`MotionGuide::Paper`]; `Default` is the paper.
#[derive(Debug, Clone, PartialEq)]
pub struct PaperParams {
    /// How anchors are sampled. Default [`AnchorSampling::Lines`].
    pub sampling: AnchorSampling,
    /// Neighbourhoods, cylinder and lines. Default: disjoint triples, global δ, 300 000 lines.
    pub anchors: anchors::AnchorParams,
    /// Welsch scale relative to the median anchor distance, β = γ·d_med (Eq. 21). Default 0.05.
    pub gamma: f64,
    /// λ0, λ1, λ2 of Eq. 22, cost units; λ1 and λ2 may be infinite. Default 0.1, 1, 1.
    pub lambdas: [f64; 3],
    /// Transport stops when no potential changes by more than this, in units of λ0. Default 1e-9.
    pub tol: f64,
    /// Sweeps after which the transport is used unconverged, with a warning. Default 20 000.
    pub max_sweeps: usize,
    /// Distance, in units of β, from which the cost counts as 1; above 0. Default 6: potentials are
    /// within 2e-9 of those of the dense problem.
    pub cutoff: f64,
}

impl Default for PaperParams {
    fn default() -> Self {
        Self {
            sampling: AnchorSampling::Lines,
            anchors: anchors::AnchorParams::default(),
            gamma: 0.05,
            lambdas: [0.1, 1.0, 1.0],
            tol: 1e-9,
            max_sweeps: 20_000,
            cutoff: 6.0,
        }
    }
}

/// Rules that combine the motion of the sources of a blended row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aggregation {
    /// Rule for positions.
    pub position: PositionRule,
    /// Rule for rotations.
    pub rotation: RotationRule,
    /// Rule for scales.
    pub scale: ScaleRule,
    /// Whether blended and recoloured rows also follow the change of opacity logit and SH of their
    /// sources since the edit frame; otherwise they keep the edit's values at all times.
    pub appearance: bool,
    /// Weight of the sources' own relative rotations in a local rigid motion, relative to their
    /// positions; 0 where the scene does not model rotation. Default 3; [`crate::propagate()`]
    /// lowers it when the source's rotations disagree with its positions.
    pub rotation_prior: f32,
    /// Whether the weight of a source falls with its opacity, relative to that at the edit frame:
    /// images do not constrain the positions of faint splats. Default on.
    pub fading: bool,
}

/// Rule for positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PositionRule {
    /// Weighted mean of the displacements (Eq. 9).
    Average,
    /// The rigid motion that best fits the motion of the row's sources (weighted Kabsch), applied
    /// to the splat: a splat at 3 % of the figure's size from a limb that rotates by 80° needs the
    /// lever arm.
    Rigid,
}

/// Rule for rotations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RotationRule {
    /// `q + Σ w Δq` on the hemisphere of each source, renormalised (Eq. 24, as printed).
    Additive,
    /// The relative rotation, composed on the left.
    Relative,
}

/// Rule for scales.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScaleRule {
    /// Mean of `s_t / s_1` per stored axis (Eq. 24, as printed).
    PerAxis,
    /// Weighted geometric mean over sources and axes: neighbours store their axes in different
    /// orders.
    Isotropic,
}

impl Aggregation {
    /// Eqs. 9 and 24 as printed.
    pub const PAPER: Self = Self {
        position: PositionRule::Average,
        rotation: RotationRule::Additive,
        scale: ScaleRule::PerAxis,
        appearance: false,
        rotation_prior: 0.0,
        fading: false,
    };
}

impl Default for Aggregation {
    fn default() -> Self {
        Self {
            position: PositionRule::Rigid,
            rotation: RotationRule::Relative,
            scale: ScaleRule::Isotropic,
            appearance: true,
            rotation_prior: 3.0,
            fading: true,
        }
    }
}

/// Options of the identity map.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentityParams {
    /// If off, every edited splat is matched by the guide. Default on.
    pub enabled: bool,
    /// Factor on the tolerances for rounding (see [`crate::IdentityMap`]); 0 admits equal values
    /// only. Default 1.
    pub tolerance: f32,
    /// Precision with which the edited splats were stored, if their file format is lossy; see
    /// [`crate::IdentityMap`]. Rows that agree within it are source splats, whose exact values
    /// [`crate::propagate()`] restores. Default none.
    pub precision: Option<Arc<Precision>>,
    /// Whether groups of source splats that were moved, rotated or scaled together are recognised.
    /// Default on; off in the presets `Paper` and `Knn`.
    pub moved: bool,
}

impl Default for IdentityParams {
    fn default() -> Self {
        Self { enabled: true, tolerance: 1.0, precision: None, moved: true }
    }
}

/// Options of the static/dynamic split.
#[derive(Debug, Clone, PartialEq)]
pub struct DynamicParams {
    /// Displacement over the key times from which a splat counts as moving, world units. `None`
    /// (default): estimated from the distribution of displacements, see [`crate::DynamicSplit`].
    pub threshold: Option<f32>,
    /// Whether displacements that neighbours do not share are ignored: splats on textureless
    /// surfaces slide along them independently. Default on; off in the presets `Paper` and `Knn`.
    pub coherent: bool,
}

impl Default for DynamicParams {
    fn default() -> Self {
        Self { threshold: None, coherent: true }
    }
}

/// Whether an edit applies to splats or to the surface that they represent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Follow {
    /// The edit applies to the splats of the edit frame and is visible as long as they are.
    #[default]
    Splats,
    /// The edit applies to the surface: splats that represent it at other times inherit the edit.
    Surface,
}

/// All options of [`crate::propagate()`].
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct MotionOptions {
    /// Method that finds correspondences.
    pub guide: MotionGuide,
    /// Rules that convert correspondences to motion.
    pub aggregation: Aggregation,
    /// Time of the frame that was edited. `None` (default): start of the source's time range.
    pub edit_time: Option<f32>,
    /// Number of times at which the source's motion is sampled, 1 to 64. Default 12.
    pub num_key_times: usize,
    /// Which edited splats are source splats.
    pub identity: IdentityParams,
    /// Which source splats move.
    pub dynamics: DynamicParams,
    /// Whether the edit applies to splats or to the surface. Default [`Follow::Splats`]; `c4d` uses
    /// [`Follow::Surface`] for scenes whose splats are visible only for a part of the clip.
    /// Requires a guide with identity.
    pub follow: Follow,
    /// Edited splats farther from every moving source splat than this share of the figure's size,
    /// and not connected to nearer edited splats, are static. Default 0.25; infinite in the paper
    /// preset.
    pub reach: f32,
}

impl MotionOptions {
    /// The options of a preset.
    pub fn preset(preset: MotionPreset) -> Self {
        let (guide, aggregation) = match preset {
            MotionPreset::Regions => {
                (MotionGuide::Regions(MotionParams::default()), Aggregation::default())
            }
            MotionPreset::Paper => (MotionGuide::Paper(PaperParams::default()), Aggregation::PAPER),
            MotionPreset::Knn => (MotionGuide::Knn(KnnParams::default()), Aggregation::PAPER),
        };
        Self {
            guide,
            aggregation,
            edit_time: None,
            num_key_times: 12,
            // the paper estimates the motion of every edited splat
            identity: IdentityParams {
                enabled: preset != MotionPreset::Paper,
                moved: preset == MotionPreset::Regions,
                ..Default::default()
            },
            follow: Follow::Splats,
            dynamics: DynamicParams {
                coherent: preset == MotionPreset::Regions,
                ..Default::default()
            },
            reach: if preset == MotionPreset::Paper { f32::INFINITY } else { 0.25 },
        }
    }

    /// The same options with the given guide.
    #[must_use]
    pub fn with_guide(mut self, guide: MotionGuide) -> Self {
        self.guide = guide;
        self
    }

    /// The same options with the given rules that convert correspondences to motion.
    #[must_use]
    pub fn with_aggregation(mut self, aggregation: Aggregation) -> Self {
        self.aggregation = aggregation;
        self
    }

    /// The same options with the given [`Follow`].
    #[must_use]
    pub fn with_follow(mut self, follow: Follow) -> Self {
        self.follow = follow;
        self
    }

    /// The baseline that evaluates `field` at the edited positions.
    pub fn field(field: Arc<dyn FieldAt>) -> Self {
        Self::preset(MotionPreset::Knn).with_guide(MotionGuide::Field(field))
    }

    pub(crate) fn check(&self) -> Result<(), AmgError> {
        let wrong = |name, found: String, expected| Err(AmgError::Option { name, found, expected });
        if !(1..=64).contains(&self.num_key_times) {
            return wrong("num_key_times", self.num_key_times.to_string(), "1 to 64");
        }
        if self.reach.is_nan() || self.reach < 0.0 {
            return wrong("reach", self.reach.to_string(), "a share, at least 0");
        }
        let tolerance = self.identity.tolerance;
        if !(tolerance >= 0.0 && tolerance.is_finite()) {
            return wrong("identity.tolerance", tolerance.to_string(), "finite, at least 0");
        }
        if let Some(threshold) = self.dynamics.threshold
            && (threshold.is_nan() || threshold < 0.0)
        {
            return wrong("dynamics.threshold", threshold.to_string(), "at least 0");
        }
        match &self.guide {
            MotionGuide::Knn(params) if !(1..=64).contains(&params.k) => {
                wrong("knn.k", params.k.to_string(), "1 to 64")
            }
            MotionGuide::Regions(params) => params.check(),
            MotionGuide::Paper(params) if !(params.gamma > 0.0 && params.gamma.is_finite()) => {
                wrong("paper.gamma", params.gamma.to_string(), "finite, above 0")
            }
            _ => Ok(()),
        }
    }
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self::preset(MotionPreset::Regions)
    }
}
