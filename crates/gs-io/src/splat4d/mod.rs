//! `.splat4d` version 1: one streamable file with a bound on every error.
//!
//! ```text
//! 0   4  "SP4D"
//! 4   2  u16 version = 1
//! 6   2  u16 flags
//! 8   4  u32 length of the JSON header
//! 12  …  JSON header, static section, one chunk per group of frames
//! ```
//!
//! Little-endian. Every value is put on a grid whose step is twice its bound. What stays within its
//! bound of one value through the whole clip is stored once, on a grid twice as fine; of the rest
//! each group of frames (GOP) stores its first frame and the differences from frame to frame. A
//! value keeps its grid point until it would violate the bound, so that noise costs nothing and
//! nothing flickers. Symbols are unsigned (zigzag), split into byte planes and compressed with
//! zstd.
//!
//! Kept: positions, sizes, rotations, base colour, opacity. Not kept: view-dependent colour.

mod decode;
mod error;
mod header;
mod options;
mod read;
mod streams;
mod survey;
mod symbols;
mod tracks;
mod value;
mod write;

pub use error::Splat4dError;
pub use options::{DEFAULT_TOLERANCE, Options};
pub use read::{Read, Splat4dScene, open, read};
pub use write::{PASSES, WriteReport, write};
