//! OpenUSD text layers: one `ParticleField3DGaussianSplat` with time samples.
//!
//! Values are written so that they read back to the same bits; attributes that never change are
//! written once. The splats keep the scene's own axes; a transform above them turns the scene's up
//! to the stage's +y. Frame `i` is time code `i`.

mod write;

pub use write::{Options, SIZE_LIMIT, WriteReport, write};
