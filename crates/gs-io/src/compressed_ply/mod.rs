//! PlayCanvas compressed PLY: what SuperSplat and `splat-transform` write, 16 bytes a splat.
//!
//! Elements `chunk` (one row per 256 splats: smallest and largest centre, log-scale and colour), `vertex` (four packed words a splat)
//! and, above SH degree 0, `sh` (one byte a coefficient). Within a chunk, centres and log-scales have 11, 10 and 11 bits, colours and
//! opacities 8, the three smaller components of the quaternion 10.

mod pack;
mod read;
mod write;

pub use read::read;
pub(crate) use read::{is_compressed, shape};
pub use write::{WriteOptions, kept_degree, morton_order, write};

/// Splats that share a row of `chunk`.
pub(crate) const CHUNK: usize = 256;
/// Columns of `chunk`, in the order in which they are written. The colours are missing in files of older tools, whose colours lie
/// between 0 and 1.
const COLUMNS: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];
/// Columns of `vertex`.
const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
/// Log-scales beyond ± this are clamped on writing.
const MAX_LOG_SCALE: f32 = 20.0;
/// Largest SH coefficient, either sign.
const MAX_SH: f32 = 4.0;
/// Bits of the three coordinates of a packed vector.
const BITS: [u32; 3] = [11, 10, 11];
