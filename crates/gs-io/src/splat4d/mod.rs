//! `.splat4d` version 1: one streamable file with bounded errors.
//!
//! ```text
//! 0   4  "SP4D"
//! 4   2  u16 version = 1
//! 6   2  u16 flags
//! 8   4  u32 length of the JSON header
//! 12  …  JSON header, static section, one chunk per group of frames
//! ```
//!
//! Little-endian. Every value is rounded to a grid whose step is twice its error bound.
//! Values that stay within the bound of one value for the whole clip are stored once, on a
//! grid twice as fine; for the others each group of frames (GOP) stores its first frame and
//! the differences between frames. A value keeps its grid point until it would violate the
//! bound, so that noise costs no bytes and causes no flicker. Symbols are unsigned
//! (zigzag), split into byte planes and compressed with zstd.
//!
//! Kept: positions, sizes, rotations, base colour, opacity. Not kept: view-dependent colour.

mod decode;
mod error;
mod header;
mod options;
mod read;
mod streams;
mod symbols;
mod tracks;
mod value;
mod value_ranges;
mod write;

pub use error::Splat4dError;
pub use options::{DEFAULT_TOLERANCE, WriteOptions};
pub use read::{OpenedClip, Splat4dScene, open, read};
pub use write::{PASSES, WriteReport, write};
