//! PlayCanvas compressed PLY, written by SuperSplat and `splat-transform`; 16 bytes per splat.
//!
//! Elements `chunk` (one row per 256 splats: smallest and largest centre, log-scale and colour),
//! `vertex` (four packed words per splat) and, above SH degree 0, `sh` (one byte per coefficient).
//! Within a chunk, centres and log-scales have 11, 10 and 11 bits, colours and opacities 8, the
//! three smaller components of the quaternion 10.

mod error;
mod layout;
mod pack;
mod read;
mod write;

pub use error::CompressedPlyError;
pub use read::read;
pub(crate) use read::{is_compressed, shape};
pub use write::{WriteOptions, kept_degree, morton_order, write};
