//! Differentiable Gaussian-splat rasteriser for the CPU, [`CpuRasterizer`], behind
//! [`gs_core::Rasterizer`].
//!
//! Contents:
//! - The image and the gradients of the 2023 tile rasteriser that 3DGS, 4DGS and Swift4D scenes
//!   were trained with: 16×16 tiles, clipping to the 3σ rectangle, the low-pass of 0.3, the skips
//!   at 1/255, 0.99 and 1e-4, ties by index. Both gradient conventions,
//!   [`gs_core::GradientConvention`].
//! - Any number of channels per pass: RGB, camera depth, and the caller's features (flow,
//!   uncertainty, masks).
//! - `f32` for production and `f64` as the reference for finite
//!   differences: one generic implementation.
//! - Bit-identical results for any number of threads: every sum has a fixed order. (Results of
//!   different instruction sets differ in the last bits.)
//! - Hostile values (NaN, infinities, zero or huge scales) never reach a pixel: a splat that is not
//!   finite in single precision is treated as absent, and its gradients are exactly zero. Finite
//!   splats whose gradient overflows get a zero gradient too.
//! - No allocation per frame once the buffers have grown, except those of the thread pool: every
//!   stage reuses [`Prepared`].
//!
//! Performance: tile lists contain only the tiles and pixel rows that a splat can affect; one task
//! handles a macro tile of 4×4 tiles; vector lanes are the columns of a row, or splats where the
//! work is per splat (projection, colours, chain rule), compiled for the machine's instruction set
//! (AVX2, AVX-512, NEON, scalar); the chain rule skips splats that no pixel drew; per-splat sums
//! stay in registers, so that gradients need no atomics.
//!
//! Deliberately absent: losses, files, GPU, antialiasing variants, gradients of the camera.
#![expect(
    clippy::inline_always,
    reason = "functions that are not inlined into the one compiled for a wider instruction set \
             stay at the baseline"
)]

mod backward;
mod bins;
mod cull;
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

pub use prepared::Prepared;
pub use times::StageTimes;

use gs_core::{
    Camera, RasterError, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, TileSet,
    UpstreamGrads,
};
use lanes::Reference;
use splat_grads::Scope;

/// The CPU rasteriser; runs on the current rayon thread pool.
/// Stateless: all memory is in [`Prepared`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CpuRasterizer {}

/// Implements [`Rasterizer`] for one float type, or generically for the types of a bound.
macro_rules! rasterizer {
    ($float:ident $(: $bound:ident)?) => {
        impl$(<$float: $bound>)? Rasterizer<$float> for CpuRasterizer {
            type Prepared = Prepared<$float>;

            fn prepare(
                &self,
                splats: &Splats<$float>,
                camera: &Camera,
            ) -> Result<Prepared<$float>, RasterError> {
                let mut prepared = Prepared::default();
                prepared.update(splats, camera, None)?;
                Ok(prepared)
            }

            fn prepare_into(
                &self,
                splats: &Splats<$float>,
                camera: &Camera,
                prepared: &mut Prepared<$float>,
            ) -> Result<(), RasterError> {
                prepared.update(splats, camera, None)
            }

            fn prepare_tiles_into(
                &self,
                splats: &Splats<$float>,
                camera: &Camera,
                tiles: &TileSet,
                prepared: &mut Prepared<$float>,
            ) -> Result<(), RasterError> {
                prepared.update(splats, camera, Some(tiles))
            }

            fn forward_into(
                &self,
                prepared: &mut Prepared<$float>,
                splats: &Splats<$float>,
                features: &[$float],
                params: &RenderParams,
                output: &mut RenderOutput<$float>,
            ) -> Result<(), RasterError> {
                forward::forward(prepared, splats, features, params, output)
            }

            fn backward_into(
                &self,
                prepared: &mut Prepared<$float>,
                splats: &Splats<$float>,
                features: &[$float],
                params: &RenderParams,
                upstream: &UpstreamGrads<$float>,
                grads: &mut RenderGrads<$float>,
            ) -> Result<(), RasterError> {
                let scope = Scope::Everything;
                backward::backward(prepared, splats, features, params, upstream, scope, grads)
            }

            fn backward_colors_into(
                &self,
                prepared: &mut Prepared<$float>,
                splats: &Splats<$float>,
                features: &[$float],
                params: &RenderParams,
                upstream: &UpstreamGrads<$float>,
                grads: &mut RenderGrads<$float>,
            ) -> Result<(), RasterError> {
                let scope = Scope::Colors;
                backward::backward(prepared, splats, features, params, upstream, scope, grads)
            }

            fn lift_into(
                &self,
                prepared: &mut Prepared<$float>,
                splats: &Splats<$float>,
                planes: &UpstreamGrads<$float>,
                channels: usize,
                sums: &mut RenderGrads<$float>,
            ) -> Result<(), RasterError> {
                backward::lift(prepared, splats, planes, channels, sums)
            }
        }
    };
}

// `f32` is not generic: its kernels are compiled here, once, and not again in every crate that
// renders.
rasterizer!(f32);
// `f64` is generic: only tests use it, and programs do not compile its kernels.
rasterizer!(F: Reference);

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
