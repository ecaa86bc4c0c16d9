//! Differentiable Gaussian-splat rasteriser for the CPU, [`CpuRasterizer`], behind
//! [`gs_core::Rasterizer`].
//!
//! Promises:
//! - The image and the gradients of the 2023 tile rasteriser that 3DGS, 4DGS and Swift4D scenes
//!   were trained with: 16×16 tiles, clipping to the 3σ rectangle, the low-pass of 0.3, the skips
//!   at 1/255, 0.99 and 1e-4, ties by index. Both gradient conventions,
//!   [`gs_core::GradientConvention`].
//! - Any number of channels per pass: RGB, camera depth, and the caller's features (flow,
//!   uncertainty, masks).
//! - `f32` for work and `f64` as the oracle of finite differences: one generic implementation.
//! - Bit-identical results for any number of threads: every sum has a fixed order. (Instruction
//!   sets differ in the last bits.)
//! - Hostile values (NaN, infinities, zero or huge scales) never reach a pixel: a splat that is not
//!   finite in single precision is culled or left out, as if it were absent, and its gradients are
//!   exactly zero. Finite splats whose gradient overflows get a zero gradient too.
//! - No allocation per frame once the buffers have grown, except those of the thread pool: every
//!   stage reuses [`Prepared`].
//!
//! How it is fast: tile lists without the tiles that a splat does not reach ([`Culling`]), with the
//! rows that it does reach; one macro tile of 4×4 tiles per task; vector lanes over the columns of
//! a row, or over splats where the work is per splat (projection, colours, chain rule), compiled
//! for the machine at hand (AVX2, AVX-512, NEON, scalar); splats that no pixel drew skipped by the
//! chain rule; per-splat sums that stay in registers, so that gradients need no atomics.
//!
//! Deliberately absent: losses, files, GPU, antialiasing variants, gradients of the camera.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the function compiled for a wider instruction set stays at the baseline"
)]

mod backward;
mod bins;
mod cull;
mod culling;
mod forward;
mod harmonics;
mod lanes;
mod prepared;
mod project;
mod project_grad;
mod shade;
mod splat_grads;
mod tile;
mod tile_grad;
mod times;
mod vector;
mod view;

pub use culling::Culling;
pub use prepared::Prepared;
pub use times::StageTimes;

use gs_core::{
    Camera, RasterError, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads,
};
use lanes::Lane;
use splat_grads::Scope;

/// The CPU rasteriser; runs on the current rayon thread pool. Stateless: everything lives in
/// [`Prepared`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CpuRasterizer {
    /// Default [`Culling::Opacity`].
    pub culling: Culling,
}

/// For `f32` and `f64`.
impl<F: Lane> Rasterizer<F> for CpuRasterizer {
    type Prepared = Prepared<F>;

    fn prepare(&self, splats: &Splats<F>, camera: &Camera) -> Result<Prepared<F>, RasterError> {
        let mut prepared = Prepared::default();
        prepared.update(splats, camera, self.culling)?;
        Ok(prepared)
    }

    fn prepare_into(
        &self,
        splats: &Splats<F>,
        camera: &Camera,
        prepared: &mut Prepared<F>,
    ) -> Result<(), RasterError> {
        prepared.update(splats, camera, self.culling)
    }

    fn forward_into(
        &self,
        prepared: &mut Prepared<F>,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
        output: &mut RenderOutput<F>,
    ) -> Result<(), RasterError> {
        forward::forward(prepared, splats, features, params, output)
    }

    fn backward_into(
        &self,
        prepared: &mut Prepared<F>,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
        upstream: &UpstreamGrads<F>,
        grads: &mut RenderGrads<F>,
    ) -> Result<(), RasterError> {
        let scope = Scope::Everything;
        backward::backward(prepared, splats, features, params, upstream, scope, grads)
    }

    fn backward_colors_into(
        &self,
        prepared: &mut Prepared<F>,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
        upstream: &UpstreamGrads<F>,
        grads: &mut RenderGrads<F>,
    ) -> Result<(), RasterError> {
        let scope = Scope::Colors;
        backward::backward(prepared, splats, features, params, upstream, scope, grads)
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
