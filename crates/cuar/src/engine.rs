//! [`DescentEngine`]: steps of Adam executed on the device that stores images, gradients and
//! moments.

use crate::{descent_image::DescentImage, loss::LossParts, loss::LossWeights};
use gs_core::RasterError;
use gs_fit::Adam;

/// The task of a [`DescentEngine`].
#[derive(Debug, Clone, Copy)]
pub struct DescentTask<'a> {
    /// SH degree of the offsets.
    pub sh_degree: usize,
    /// Learning rate per column of the offsets, `[3K]` (K coefficients of three channels).
    pub rates: &'a [f32],
    /// η and ζ.
    pub weights: LossWeights,
    /// Bytes of supervised images that may be kept; others are uploaded again at every step.
    pub memory: usize,
}

/// Executes the steps of [`crate::Solver::Adam`] for a [`crate::Backend`], on prepared states `P`
/// of its rasteriser.
///
/// With offsets `Δ` (`[E,K,3]`) the render of an image is
/// `original + Σ (max(c + Y(d)·Δ, 0) − max(c, 0))·αT` over its entries, at live pixels. The
/// objective is Eq. 20 with exact L1, as means over the whole image. Each step is one of [`Adam`]
/// over all rows, including those without a gradient.
pub trait DescentEngine<P> {
    /// Starts from these offsets, and the moments and steps of `adam`.
    ///
    /// # Errors
    /// If the device fails or has too little memory.
    fn begin(
        &mut self,
        task: &DescentTask,
        d_sh: &[[f32; 3]],
        adam: &Adam<f32>,
    ) -> Result<(), RasterError>;

    /// One step for one image; `prepared` contains its splats as seen from its camera.
    ///
    /// # Errors
    /// If the device fails.
    fn step(&mut self, image: &DescentImage, prepared: &mut P) -> Result<(), RasterError>;

    /// The losses of the steps since the last call, in order, each evaluated before its step.
    ///
    /// # Errors
    /// If the device fails.
    fn losses(&mut self) -> Result<Vec<LossParts>, RasterError>;

    /// The render of the last step's image, before that step, `[h,w,3]` of its crop.
    ///
    /// # Errors
    /// If the device fails.
    fn render(&mut self) -> Result<Vec<f32>, RasterError>;

    /// Copies the offsets, the moments and the number of steps to the host.
    ///
    /// # Errors
    /// If the device fails.
    fn read(&mut self, d_sh: &mut [[f32; 3]], adam: &mut Adam<f32>) -> Result<(), RasterError>;
}

/// A rasteriser, and optionally an engine for [`crate::Solver::Adam`].
pub struct Backend<'a, R: gs_core::Rasterizer> {
    /// Renders and differentiates.
    pub raster: &'a R,
    /// Executes whole steps of Adam; if `None`, they run on the host.
    pub descent: Option<&'a mut dyn DescentEngine<R::Prepared>>,
}

impl<R: gs_core::Rasterizer> std::fmt::Debug for Backend<'_, R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Backend").field("descent", &self.descent.is_some()).finish_non_exhaustive()
    }
}
