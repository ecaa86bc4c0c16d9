//! Losses of the refinement (Eqs. 18–20) and their parts, generic over the float type; reusable
//! without the rest of the crate.
//!
//! Images are interleaved `[H,W,C]`, row-major; a gradient has the shape of its argument; values
//! are **means** over all pixels and channels of the whole image, like the losses of 3DGS (the
//! paper writes norms).

mod l1;
mod objective;

pub use l1::masked_l1;
pub use objective::{L1Shape, LossParts, LossWeights, Objective, Targets};
