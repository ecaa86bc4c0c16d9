//! `.tsog` archives (Gmira et al. 2026), version 4: the planes of SOG with a time for every splat.
//!
//! A zip archive of `meta.json` and lossless WebP planes, one pixel per splat. A continuous
//! timeline gives each splat a centre c and a standard deviation σ in time, and the archive may
//! contain velocities: opacity `α·exp(−½((t − c)/σ)²)`, position `x + v·(t − c)`, t from 0 to 1. A
//! discrete timeline of N frames assigns each splat to one frame. Without a timeline nothing
//! changes. Unlike those of SOG, codebooks may have fewer than 256 values.

mod error;
mod meta;
mod read;
mod rows;

pub use error::TsogError;
pub use read::open;

pub(crate) use meta::{is_meta, is_timed};
