//! Differentiable Gaussian-splat rasteriser in WGSL compute
//! shaders, on any adapter that wgpu supports.
//!
//! Computes the image formation and the gradients of the reference kernels
//! ([`gs_core::image_formation`]; conventions `Reference` and `Exact`), within single
//! precision, behind [`gs_core::Rasterizer`]. Core WGSL within WebGPU's default
//! limits; subgroups, float atomics and larger limits are used where the adapter
//! supports them. Splats with non-finite values draw nothing and have zero gradients.
//! Running out of memory is an error, never an image of zeros.
//!
//! Determinism: images are bit-identical from run to run. So are gradients with
//! [`GpuOptions::deterministic`] or [`GpuOptions::portable`]; otherwise float atomics are used, the
//! order in which tiles add to a splat varies, and the last bits with it.
//!
//! Deliberately absent: losses, optimisers, files, windows.

/// Building blocks for passes of other crates on the same device:
/// growing buffers, and commands submitted together.
pub mod device {
    pub use crate::buffers::{GrowBuffer, write};
    pub use crate::channel_passes::row_chunks;
    pub use crate::commands::{CommandMemory, Commands, Stamps, read};
    pub use crate::primitives::download;
}
pub mod kernels;
pub mod layout;
pub mod shaders;

mod adapter;
mod backward;
mod buffers;
mod channel_passes;
mod commands;
mod context;
mod error;
mod forward;
mod prepared;
mod primitives;
mod renderer;
mod resident;
mod scan;
mod sort;

pub use adapter::{AdapterChoice, AdapterKind, AdapterSummary};
pub use commands::PassTiming;
pub use context::{GpuContext, GpuOptions};
pub use error::GpuError;
pub use prepared::GpuPrepared;
pub use renderer::{Stages, WgpuRasterizer};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
