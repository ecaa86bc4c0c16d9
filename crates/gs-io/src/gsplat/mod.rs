//! Checkpoints of gsplat's trainers (`ckpt_*.pt`): a dictionary `splats` with `means`,
//! `scales`, `quats`, `opacities`, `sh0`, `shN`. With `times`, `durations` and
//! `velocities` it is a dynamic scene ([`crate::freetime`]).

mod contents;
mod error;
mod read;

pub(crate) use contents::{Contents, contents};
pub use error::GsplatError;
pub(crate) use read::{column, read, splats};
