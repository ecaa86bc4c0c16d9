//! Deformation fields of dynamic Gaussian splats, evaluated at any time for all Gaussians at once.
//!
//! [`HexPlaneScene`] matches the 4DGaussians reference implementation within single-precision
//! rounding, for every combination of flags which that implementation can evaluate;
//! [`HashGridScene`] evaluates Swift4D models in single precision; [`TabulatedScene`] interpolates
//! tabulated frames and is exact at them; [`PolynomialScene`] moves every splat along its own
//! cubic; [`StaticScene`] never moves. All are [`gs_core::DynamicScene`]s, run on all cores, and
//! give bit-identical results for any number of threads (but not on every processor, because the
//! vector width changes rounding).
//!
//! Deliberately absent: files (see `gs-io`), GPU, training.
//!
//! Conventions: arrays are those of [`gs_core::Splats`]: *stored* parameters (log-scales, logits,
//! raw quaternions `wxyz`) in the world frame. Network time is dimensionless, 0 to 1 over the
//! captured sequence.

#![expect(
    clippy::inline_always,
    reason = "kernels must inline into the function that run-time dispatch compiles for the processor's vector instructions"
)]

mod deform_mlp;
mod embedding;
mod error;
mod evaluate;
pub mod frames;
mod gaussian4d;
mod geometry_scene;
mod hash_grid;
mod head;
mod hexplane;
mod linear;
mod mask;
mod network;
mod node_graph;
mod polynomial;
mod sampling;
mod scene;
mod shape;
mod smooth_grid;
mod static_scene;
mod tabulated_scene;
mod trace;

pub use deform_mlp::{DeformMlp, DeformMlpParts, MlpOutputs, MlpScene, Warp};
pub use embedding::{EmbeddingScene, EmbeddingStage};
pub use error::FieldError;
pub use gaussian4d::{Gaussian4dScene, Gaussians4d};
pub use geometry_scene::{GeometryField, GeometryScene};
pub use hash_grid::{
    FieldBox, GridShape, HashGrid, HashGridField, HashGridNetwork, HashGridScene, IndexRule, Level,
};
pub use head::Head;
pub use hexplane::{HexPlane, PLANE_AXES, Plane};
pub use linear::Linear;
pub use mask::{EmptyVoxel, Mask};
pub use network::{Component, Heads, HexPlaneField, HexPlaneNetwork};
pub use node_graph::{NodeGraph, NodeGraphScene};
pub use polynomial::{FadeLimits, Polynomial, PolynomialError, PolynomialScene};
pub use scene::{DEFAULT_CACHE_LIMIT, HexPlaneScene};
pub use shape::RasterizedShapes;
pub use smooth_grid::{
    Attention, MovingRows, SmoothGrid, SmoothGridField, SmoothGridNetwork, SmoothGridParts,
    SmoothGridScene,
};
pub use static_scene::StaticScene;
pub use tabulated_scene::{TabulatedScene, TabulatedSceneError};
pub use trace::Trace;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
