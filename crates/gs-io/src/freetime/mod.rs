//! Scenes of FreeTimeGS (Wang et al. 2025), in the formats of its open implementation: `.ftgs.ply`,
//! and checkpoints (`.pt`) in gsplat's format.
//!
//! Each splat moves along a line and fades in and out around its own time: `x + v·(t − τ)`, opacity
//! `max(σ(o)·exp(−½((t − τ)/max(eᵈ, d_min))²), floor)`, t from 0 to 1, frame i of n at i/(n − 1).

mod checkpoint;
mod error;
mod model;
mod ply_file;
mod read;

pub use error::FreeTimeError;
pub(crate) use read::has_columns;
pub use read::open;
