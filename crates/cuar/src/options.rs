//! [`RefineOptions`]: options of a refinement.

use crate::{CuarError, EvidenceParams, WarpForm, WarpParams, loss::LossWeights};

/// Predefined [`RefineOptions`], named as the values of `c4d refine --preset`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum RefinePreset {
    /// The options with the smallest measured error against known truth; those of
    /// [`RefineOptions::default`].
    #[default]
    Default,
    /// The paper's formulas and constants: Adam, Eq. 13 as written, no floor under the mask.
    Paper,
}

/// Minimiser of the objective.
#[derive(Debug, Clone, PartialEq)]
pub enum Solver {
    /// Weighted least squares per splat, on the colours observed in the images (see
    /// [`RegressionParams`]).
    Regression(RegressionParams),
    /// Adam, one image per step.
    Adam(AdamParams),
}

/// The regression solver: majorise–minimise.
///
/// With geometry and opacity fixed, a pixel is a sub-convex combination of splat colours, so the
/// (reweighted) quadratic model of the objective separates over splats: every image gives one
/// weighted observation of the colour of every visible splat. A splat's SH is the weighted
/// least-squares fit to all observations and, with a large weight, to its colours in the edited
/// frame from every view. There is no step size.
#[derive(Debug, Clone, PartialEq)]
pub struct RegressionParams {
    /// Maximum evaluations of every image. The solver stops earlier after a pass that lowers the
    /// loss by less than 0.5 %. Default 8.
    pub passes: usize,
    /// Width δ of the smoothed L1, colour units. Default 0.01.
    pub delta: f64,
    /// Over-relaxation of the observed colours, in (0, 2). Default 1.5.
    pub relaxation: f64,
    /// Weight of the term that keeps a splat at its colours in the edited frame, relative to the
    /// weight of the same pixels in the background loss; lower for splats that are barely visible
    /// there. These colours are correct by definition, and pixels alone do not separate the colours
    /// of neighbours. Default 1000; 0 treats the edited frame like any other image. No effect unless
    /// the edited frame is among the images.
    pub anchor_weight: f64,
    /// Smoothness over directions: ridge on the refined coefficients of degree `l`, relative to the
    /// weight of the splat's observations: `prior · l²` times the share of images in which the
    /// splat's ξ exceeds the mask's threshold (and, on the change of DC, a thousandth of `prior`).
    /// In unobserved directions, colours become those of the smoothest function through the
    /// observations, instead of those of an unsupervised fit. Default 0.03; 0 fits the
    /// images alone.
    pub prior: f64,
}

impl Default for RegressionParams {
    fn default() -> Self {
        Self { passes: 8, delta: 0.01, relaxation: 1.5, anchor_weight: 1000.0, prior: 0.03 }
    }
}

/// The Adam solver. The paper states neither optimiser nor rates; these are those of 3DGS for SH.
#[derive(Debug, Clone, PartialEq)]
pub struct AdamParams {
    /// Steps, one image each. Default 3000.
    pub steps: usize,
    /// Learning rate of the DC coefficients. Default 0.0025.
    pub rate_dc: f32,
    /// Learning rate of the other coefficients. Default 0.000125.
    pub rate_rest: f32,
}

impl Default for AdamParams {
    fn default() -> Self {
        Self { steps: 3000, rate_dc: 0.0025, rate_rest: 0.000_125 }
    }
}

/// Options of a refinement.
#[derive(Debug, Clone, PartialEq)]
pub struct RefineOptions {
    /// Scene time of the edited frame. Default `None`: the start of the scene.
    pub edit_time: Option<f32>,
    /// ε of Eq. 17, 0.5 to 2 in the paper (smaller: broader masks). Default 0.5.
    pub epsilon: f32,
    /// Uncertainty below which no pixel is an artifact. Default 0.02 (a colour change
    /// of 5 of 255, summed over channels); 0 in the paper.
    pub min_uncertainty: f32,
    /// Form of Eq. 13.
    pub warp: WarpForm,
    /// Occlusion test of [`WarpForm::Backward`].
    pub warp_params: WarpParams,
    /// η and ζ.
    pub weights: LossWeights,
    /// Minimiser.
    pub solver: Solver,
    /// Detection and repair of splats that frame 1 does not supervise ([`crate::refine_edit()`]);
    /// `None` for neither, as in the paper.
    pub evidence: Option<EvidenceParams>,
    /// Images (pairs of view and time) drawn. Default 60: with 30 to 240, the PSNR within the mask
    /// differs by less than 0.5 dB in seven cases, and 60 is within 0.4 dB of the best in each
    /// (`docs/BENCHMARKS.md`). 240 for the paper's preset, which draws one at each step.
    pub samples: usize,
    /// Whether the edited frame is among the images, from every view (but at most 20 of the cameras
    /// with a time), so that it keeps its colours. Default true; false in the paper.
    pub keep_first_frame: bool,
    /// Random seed of the drawn images and of the order of steps. Default 0.
    pub seed: u64,
    /// Memory for images and prepared states, bytes. States that do not fit are prepared again at
    /// every evaluation; if the images do not fit, fewer are drawn. Default 2 GiB.
    pub memory: usize,
    /// Background of the renders, RGB, 0 to 1. Default black.
    pub background: [f64; 3],
    /// Minimum seconds between two previews. Default `None`: no previews.
    pub preview_secs: Option<f64>,
    /// Minimum seconds between two checkpoints. Default `None`: only that of a cancelled run.
    pub checkpoint_secs: Option<f64>,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            edit_time: None,
            epsilon: 0.5,
            min_uncertainty: 0.02,
            warp: WarpForm::Backward,
            warp_params: WarpParams::default(),
            weights: LossWeights::default(),
            solver: Solver::Regression(RegressionParams::default()),
            evidence: Some(EvidenceParams::default()),
            samples: 60,
            keep_first_frame: true,
            seed: 0,
            memory: 2 << 30,
            background: [0.0; 3],
            preview_secs: None,
            checkpoint_secs: None,
        }
    }
}

impl RefineOptions {
    /// The options of a preset.
    pub fn preset(preset: RefinePreset) -> Self {
        match preset {
            RefinePreset::Default => Self::default(),
            RefinePreset::Paper => Self {
                min_uncertainty: 0.0,
                warp: WarpForm::Paper,
                warp_params: WarpParams { slack: None, ..WarpParams::default() },
                solver: Solver::Adam(AdamParams::default()),
                evidence: None,
                samples: 240,
                keep_first_frame: false,
                ..Self::default()
            },
        }
    }

    /// Checks every value against its range, as [`crate::refine()`] does first.
    ///
    /// # Errors
    /// For the first value out of range.
    pub fn check(&self) -> Result<(), CuarError> {
        let within = |name: &str, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(CuarError::input(format!("`{name}` is {value}, expected {low} to {high}")))
            }
        };
        within("epsilon", f64::from(self.epsilon), 0.0, 1e6)?;
        within("min_uncertainty", f64::from(self.min_uncertainty), 0.0, 1.0)?;
        within("eta", self.weights.eta, 0.0, 1.0)?;
        within("zeta", self.weights.zeta, 0.0, 1.0)?;
        within("min_coverage", f64::from(self.warp_params.min_coverage), 0.0, 1.0)?;
        within("depth_tolerance", f64::from(self.warp_params.depth_tolerance), 0.0, 1e6)?;
        within("spread_tolerance", f64::from(self.warp_params.spread_tolerance), 0.0, 1e6)?;
        within("min_known_color", f64::from(self.warp_params.min_known_color), 0.0, 1e6)?;
        within("min_visible_share", f64::from(self.warp_params.min_visible_share), 1e-6, 1e6)?;
        within("min_facing", f64::from(self.warp_params.min_facing), -1e6, 1e6)?;
        within("samples", self.samples as f64, 1.0, 1e7)?;
        if let Some(evidence) = &self.evidence {
            within("hidden", f64::from(evidence.hidden), 0.0, 1.0)?;
            within("supervised", f64::from(evidence.supervised), f64::from(evidence.hidden), 1.0)?;
            within("min_change", f64::from(evidence.min_change), 0.0, 3.0)?;
            within("hue_spread", f64::from(evidence.hue_spread), 1e-4, 1e4)?;
            within("light_spread", f64::from(evidence.light_spread), 1e-4, 1e4)?;
            within("strain", evidence.strain, 1e-6, 1e6)?;
            within("min_agreement", f64::from(evidence.min_agreement), 0.0, 1.0)?;
        }
        for channel in self.background {
            within("background", channel, 0.0, 1.0)?;
        }
        match &self.solver {
            Solver::Regression(params) => {
                within("passes", params.passes as f64, 0.0, 1e6)?;
                within("anchor_weight", params.anchor_weight, 0.0, 1e9)?;
                within("delta", params.delta, 1e-6, 1.0)?;
                within("relaxation", params.relaxation, 1e-3, 1.999)?;
                within("prior", params.prior, 0.0, 1e6)?;
            }
            Solver::Adam(params) => {
                within("steps", params.steps as f64, 0.0, 1e9)?;
                within("rate_dc", f64::from(params.rate_dc), 0.0, 1e3)?;
                within("rate_rest", f64::from(params.rate_rest), 0.0, 1e3)?;
            }
        }
        Ok(())
    }
}
