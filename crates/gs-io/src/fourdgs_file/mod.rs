//! `.4dgs` containers (4dgs.dev), through the crate `fourdgs`: scenes of the temporal model
//! `gaussian-birth`.
//!
//! Each row moves along a line, fades in and out around its own time, and exists only within a
//! time window. Times are in seconds of the scene's clock. Windows are half-open, so that nothing
//! is visible at the very end; time 1 is mapped to the instant before it. Other motion is written
//! as several rows per splat, with consecutive windows.

mod error;
mod grid;
mod read;
mod segments;
mod write;

pub use error::FourdgsError;
pub use read::open;
pub use write::{DEFAULT_TOLERANCE, WriteOptions, WriteReport, evaluations, write};
