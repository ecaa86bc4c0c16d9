//! [`DescentEngine`]: whole steps of Adam on the device that holds images, gradients and moments.

use crate::{descent_image::DescentImage, loss::LossParts, loss::LossWeights};
use gs_core::RasterError;
use gs_fit::Adam;

/// The task of a [`DescentEngine`].
#[derive(Debug, Clone, Copy)]
pub struct DescentTask<'a> {
    /// Degree of the offsets.
    pub sh_degree: usize,
    /// Learning rate per column of the offsets, `[3K]`.
    pub rates: &'a [f32],
    /// η and ζ.
    pub weights: LossWeights,
    /// Bytes of supervised images that may be kept; others are uploaded again at every step.
    pub memory: usize,
}

/// Does the steps of [`crate::Solver::Adam`] for a [`crate::Backend`], on prepared states `P` of
/// its rasteriser.
///
/// With offsets `Δ` (`[E,K,3]`) the render of an image is
/// `original + Σ (max(c + Y(d)·Δ, 0) − max(c, 0))·αT` over its entries, where it is live; the
/// objective Eq. 20, exact L1, means over the whole image. A step is one of [`Adam`] with all rows,
/// those without gradient, too.
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

    /// One step down the gradient of one image; `prepared` holds its splats, seen by its camera.
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

    /// Copies offsets, moments and steps out.
    ///
    /// # Errors
    /// If the device fails.
    fn read(&mut self, d_sh: &mut [[f32; 3]], adam: &mut Adam<f32>) -> Result<(), RasterError>;
}

/// A rasteriser, and optionally an engine for [`crate::Solver::Adam`].
pub struct Backend<'a, R: gs_core::Rasterizer> {
    /// Renders and differentiates.
    pub raster: &'a R,
    /// Does whole steps of Adam; `None`: the host does them.
    pub descent: Option<&'a mut dyn DescentEngine<R::Prepared>>,
}

impl<R: gs_core::Rasterizer> std::fmt::Debug for Backend<'_, R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Backend").field("descent", &self.descent.is_some()).finish_non_exhaustive()
    }
}
