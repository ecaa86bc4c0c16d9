//! Checkpoints of native 4D Gaussians (Yang et al. 2024,
//! `chkpnt30000.pth`): Gaussians in space and time.
//!
//! The file is a tuple of unnamed parameters. Neither it nor `cfg_args` states the time range of
//! the scene, so the user must provide it
//! ([`OpenOptions::time_duration`](crate::OpenOptions::time_duration)), in the unit of training (0
//! to 10 for Neural 3D Video).

mod error;
mod read;
mod tuple;

pub use error::Gaussian4dError;
pub use read::open;
pub(crate) use read::{is_checkpoint, looks_like_model};
