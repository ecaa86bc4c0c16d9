//! `.4dgs` containers (4dgs.dev), through the crate `fourdgs`: scenes of the temporal model
//! `gaussian-birth`.
//!
//! Each splat moves on a line, fades in and out around its own time, and exists within a window of
//! time only. Times are seconds of the scene's clock. Windows are half open, so that nothing is
//! visible at the very end: time 1 is the instant before it.

mod read;

pub use read::open;
