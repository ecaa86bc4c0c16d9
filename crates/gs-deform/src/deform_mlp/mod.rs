//! Fully connected deformation networks on encoded position and
//! time, as in Deformable-3D-Gaussians.

mod encoding;
mod evaluate;
mod network;
mod scene;
mod screw;

pub use evaluate::MlpOutputs;
pub use network::{DeformMlp, DeformMlpParts, Warp};
pub use scene::MlpScene;
