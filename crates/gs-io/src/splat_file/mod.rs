//! `.splat` frames: 32 bytes per row, no header.
//!
//! Row: centre 3 × `f32`, standard deviations 3 × `f32` (linear), red, green, blue and opacity as
//! bytes from 0 to 1, quaternion `wxyz` as bytes `128·q + 128`. No view-dependent colour.

mod error;
mod read;
mod write;

pub use error::SplatFileError;
pub use read::read;
pub use write::write;
