//! [`Rasterizer`]: prepare once, composite as often as colours change, differentiate.

use crate::{Camera, CameraError, Image, Splats, SplatsError};
use thiserror::Error;

/// What a render needs besides splats and camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderParams {
    /// Background colour, added to RGB only as `transmittance · background`.
    pub background: [f32; 3],
    /// Which derivative to compute (backward only).
    pub gradients: GradientConvention,
}

impl Default for RenderParams {
    fn default() -> Self {
        Self { background: [0.0; 3], gradients: GradientConvention::Reference }
    }
}

/// Two conventions for the backward pass (`rasteriser.md` §6).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GradientConvention {
    /// What the reference kernels compute; published training used it.
    #[default]
    Reference,
    /// The true derivative with all discrete decisions frozen.
    Exact,
}

/// Images composited for one camera.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RenderOutput {
    /// `Σ f α T + T_final·background`, `[H,W,3]`.
    pub rgb: Image,
    /// `1 − T_final`, `[H,W,1]`.
    pub alpha: Image,
    /// `Σ z α T`, camera depth, not divided by alpha, `[H,W,1]`.
    pub depth: Image,
    /// `Σ f α T` of the caller's channels, no background, `[H,W,F]`.
    pub features: Image,
}

/// `∂L/∂output`, shapes of [`RenderOutput`]; an empty image means zero.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UpstreamGrads {
    /// `[H,W,3]`.
    pub v_rgb: Image,
    /// `[H,W,1]`.
    pub v_alpha: Image,
    /// `[H,W,1]`.
    pub v_depth: Image,
    /// `[H,W,F]`.
    pub v_features: Image,
}

/// `∂L/∂parameter` of the **stored** parameters (activations differentiated too), shapes of [`Splats`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RenderGrads {
    /// `[N,3]`.
    pub v_means: Vec<[f32; 3]>,
    /// `[N,4]`, with respect to the raw quaternion.
    pub v_quats: Vec<[f32; 4]>,
    /// `[N,3]`.
    pub v_log_scales: Vec<[f32; 3]>,
    /// `[N]`.
    pub v_opacity_logits: Vec<f32>,
    /// `[N,K,3]`.
    pub v_sh: Vec<[f32; 3]>,
    /// `[N,F]`, flat.
    pub v_features: Vec<f32>,
    /// With respect to the projected centre, per pixel, `[N,2]`.
    pub v_means2d: Vec<[f32; 2]>,
}

/// Why a rasteriser refused.
#[derive(Debug, Error)]
pub enum RasterError {
    /// The camera cannot see.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The splats' arrays disagree.
    #[error(transparent)]
    Splats(#[from] SplatsError),
    /// An argument has another shape than the prepared state.
    #[error("rasteriser: `{what}` has {found} values, expected {expected}")]
    Shape {
        /// Name of the argument.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Values needed.
        expected: usize,
    },
    /// The device refused or ran out of memory.
    #[error("rasteriser: {0}")]
    Device(String),
}

/// A differentiable splat rasteriser with the semantics of `rasteriser.md`.
///
/// The prepared state holds what depends on geometry and camera alone (projection, depth order, tile lists) and is reusable for as long
/// as neither changes.
pub trait Rasterizer {
    /// Geometry seen by one camera, ready to composite.
    type Prepared;

    /// Projects, culls, sorts and bins.
    ///
    /// # Errors
    /// If the camera or the splats are malformed, or the device fails.
    fn prepare(&self, splats: &Splats, camera: &Camera) -> Result<Self::Prepared, RasterError>;

    /// Composites the splats' own colours (SH towards the prepared camera) and `features` (`[N,F]`, flat).
    ///
    /// # Errors
    /// If shapes disagree with the prepared state, or the device fails.
    fn forward(
        &self,
        prepared: &Self::Prepared,
        splats: &Splats,
        features: &[f32],
        params: &RenderParams,
    ) -> Result<RenderOutput, RasterError>;

    /// Gradients of every parameter.
    ///
    /// # Errors
    /// As [`Rasterizer::forward`].
    fn backward(
        &self,
        prepared: &Self::Prepared,
        splats: &Splats,
        features: &[f32],
        params: &RenderParams,
        upstream: &UpstreamGrads,
    ) -> Result<RenderGrads, RasterError>;

    /// Gradient of the colours and features alone, in a single pass over the prepared lists: fills `v_sh` and `v_features`.
    ///
    /// # Errors
    /// As [`Rasterizer::forward`].
    fn backward_colors(
        &self,
        prepared: &Self::Prepared,
        splats: &Splats,
        features: &[f32],
        params: &RenderParams,
        upstream: &UpstreamGrads,
    ) -> Result<RenderGrads, RasterError>;
}
