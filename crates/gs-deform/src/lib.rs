//! Deformation fields of dynamic Gaussian splats, evaluated at any time for all Gaussians at once.
//!
//! Promises: [`HexPlaneScene`] gives the numbers of the 4DGaussians reference implementation within single-precision
//! rounding, for every combination of flags that implementation can evaluate; [`HashGridScene`] evaluates Swift4D models in
//! single precision; [`Trajectories`] interpolates tabulated frames and is exact at them; [`PolynomialScene`] moves every splat
//! along its own cubic; [`StaticScene`] never moves. All are [`gs_core::DynamicScene`]s, run on all cores, and
//! give the same bits for any number of threads (but not for any processor: vector width changes rounding).
//!
//! Deliberately absent: files (see `gs-io`), GPU, training.
//!
//! Conventions: arrays are those of [`gs_core::Splats`]: *stored* parameters (log-scales, logits, raw quaternions
//! `wxyz`) in the world frame. Network time is dimensionless, 0 to 1 over the captured sequence.

#![expect(
    clippy::inline_always,
    reason = "kernels must inline into the function that run-time dispatch compiles for the processor's vector instructions"
)]

mod error;
mod evaluate;
pub mod frames;
mod hash_grid;
mod head;
mod hexplane;
mod linear;
mod mask;
mod network;
mod polynomial;
mod sampling;
mod scene;
mod static_scene;
mod trace;
mod trajectories;

pub use error::FieldError;
pub use hash_grid::{
    FieldBox, GridShape, HashGrid, HashGridField, HashGridNetwork, HashGridScene, IndexRule, Level,
};
pub use head::Head;
pub use hexplane::{HexPlane, PLANE_AXES, Plane};
pub use linear::Linear;
pub use mask::{EmptyVoxel, Mask};
pub use network::{Component, Heads, HexPlaneField, HexPlaneNetwork};
pub use polynomial::{Polynomial, PolynomialError, PolynomialScene};
pub use scene::{DEFAULT_CACHE_LIMIT, HexPlaneScene};
pub use static_scene::StaticScene;
pub use trace::Trace;
pub use trajectories::{Trajectories, TrajectoryError};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
