//! One still frame of Gaussians, in any common format.
//!
//! [`read()`] detects the format by content, not by name: 3DGS PLY, PlayCanvas compressed
//! PLY, `.splat`, `.spz` versions 2 to 4, `.sog`, glTF. All return stored
//! (pre-activation) parameters. Lossy formats also report their precision
//! ([`Frame::precision`]), so that rounding can be distinguished from edits.

mod error;
mod folder;
mod format;
mod read;
mod still_frame;

pub use error::FrameError;
pub use folder::file_of;
pub use format::{FrameFormat, Shape};
pub use read::{read, read_file, shape};
pub use still_frame::Frame;

pub(crate) use folder::still_of as still_of_folder;
