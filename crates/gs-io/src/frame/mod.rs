//! One still frame of Gaussians, in whatever format an editor left it.
//!
//! [`read()`] goes by content, never by name: 3DGS PLY, PlayCanvas compressed PLY, `.splat`, `.spz`
//! versions 2 to 4, `.sog`, glTF. All give stored (pre-activation) parameters. Formats that round
//! also say how coarsely ([`Frame::precision`]), so that what only the format changed can be told
//! from what a person changed.

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
