//! OpenUSD text layers: one `ParticleField3DGaussianSplat` with time samples.
//!
//! Values round-trip to the same bits; constant attributes are written once. The
//! splats keep the scene's axes; a transform above them rotates the scene's up
//! direction to the stage's +y. Frame `i` is time code `i`.

mod write;

pub use write::{SIZE_LIMIT, WriteOptions, WriteReport, write};
