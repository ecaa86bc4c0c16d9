//! [`FitOptions`].

use crate::FitError;

/// Adam's learning rates. That of the means is in splat sizes (median of the mean standard
/// deviations of the selected splats), so that it does not depend on the scene's scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitRates {
    /// Rate of the means, splat sizes; decays to a tenth over the fit.
    pub means: f32,
    /// Rate of the raw quaternions (wxyz).
    pub quats: f32,
    /// Rate of the log-scales.
    pub log_scales: f32,
    /// Rate of the opacity logits.
    pub opacity_logits: f32,
    /// Rate of the DC coefficients of SH; the others get a twentieth.
    pub sh: f32,
}

impl Default for FitRates {
    fn default() -> Self {
        Self { means: 0.8, quats: 0.004, log_scales: 0.02, opacity_logits: 0.06, sh: 0.02 }
    }
}

/// Options of [`crate::fit()`].
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// Steps of Adam, one picture each. Default 800.
    pub steps: usize,
    /// Learning rates.
    pub rates: FitRates,
    /// Whether positions, rotations and scales are fitted; colour and opacity always are. Default
    /// true.
    pub geometry: bool,
    /// Whether splats are added where gradients are large (with [`FitOptions::geometry`]), and
    /// removed where at least three pictures show the background. Default true.
    pub densify: bool,
    /// Share of D-SSIM in the loss. Default 0.2, as in 3DGS training.
    pub dssim: f32,
    /// Difference of a channel (0 to 1) above which a pixel is edited. Default 8/255: larger than
    /// typical errors of lossy formats.
    pub threshold: f32,
    /// Masks are dilated by this share of the longer image side. Default 0.01.
    pub dilation: f32,
    /// Share of a splat's visible pixels that must lie in the masks for it to be selected. Default
    /// 0.5.
    pub vote: f32,
    /// Background over which the pictures are composited, RGB, 0 to 1. Default black.
    pub background: [f64; 3],
    /// Whether differences between the pictures (gain, offset, displacement) are estimated and
    /// removed. Default true.
    pub align: bool,
    /// Index of the view to whose picture the others are aligned; `None` for the mean of all.
    pub reference: Option<usize>,
    /// Random seed of the order of views and of the positions of new splats. Default 0.
    pub seed: u64,
    /// Minimum seconds between previews; `None` for none.
    pub preview_secs: Option<f64>,
    /// Minimum seconds between checkpoints.
    pub checkpoint_secs: f64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            steps: 800,
            rates: FitRates::default(),
            geometry: true,
            densify: true,
            dssim: 0.2,
            threshold: 8.0 / 255.0,
            dilation: 0.01,
            vote: 0.5,
            background: [0.0; 3],
            align: true,
            reference: None,
            seed: 0,
            preview_secs: None,
            checkpoint_secs: 20.0,
        }
    }
}

impl FitOptions {
    pub(crate) fn check(&self, num_views: usize) -> Result<(), FitError> {
        let refuse =
            |name, found: String, expected| Err(FitError::Option { name, found, expected });
        if self.steps == 0 || self.steps > 1_000_000 {
            return refuse("steps", self.steps.to_string(), "1 to 1 000 000");
        }
        if self.reference.is_some_and(|view| view >= num_views) {
            return refuse("reference", format!("{:?}", self.reference), "the index of a view");
        }
        let unit = 0.0..=1.0;
        for (name, value) in [
            ("dssim", self.dssim),
            ("threshold", self.threshold),
            ("dilation", self.dilation),
            ("vote", self.vote),
        ] {
            if !unit.contains(&value) {
                return refuse(name, value.to_string(), "0 to 1");
            }
        }
        Ok(())
    }
}
