//! SOG frames version 2 (PlayCanvas): a zip archive or folder of `meta.json`
//! and lossless WebP planes, one pixel per splat.
//!
//! Centres have 16 bits per axis after `sign(x)·ln(1 + |x|)`; scales and colours are indices into
//! codebooks of 256 values; quaternions store their smaller three components in bytes and the slot
//! of the largest in alpha; SH above degree 0 are entries of a palette.

mod error;
mod read;

pub use error::SogError;
pub use read::read;

pub(crate) use read::read_planes;
