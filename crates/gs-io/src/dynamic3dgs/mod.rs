//! Results of Dynamic 3D Gaussians (Luiten et al. 2024), `params.npz`: persistent splats, tabulated
//! frame by frame.
//!
//! `means3D`, `rgb_colors` (plain RGB) and `unnorm_rotations` are `[T, N, …]`; `logit_opacities`
//! `[N, 1]` and `log_scales` `[N, 3]` do not change. Cameras, segmentation colours and per-camera
//! colour corrections are ignored.

mod array;
mod error;
mod read;

pub use error::Dynamic3dgsError;
pub use read::open;
pub(crate) use read::{file_of, is_archive};
