//! Model folders of E-D3DGS (Bae et al. 2024): a network on an embedding per splat and one per
//! time.
//!
//! `point_cloud/iteration_N/` contains `point_cloud.ply` with columns `embedding_0 …` and
//! `deformation.pth`. The heads in use, the sampling of the table of times, and the
//! iteration at which the deformation began are stored only in `cfg_args`; without it
//! the published defaults are used, with a note. The iteration number affects the
//! evaluation, because early checkpoints are annealed.

mod error;
mod options;
mod read;
mod stage;

pub use error::Ed3dgsError;
pub(crate) use read::looks_like_model;
pub use read::open;
