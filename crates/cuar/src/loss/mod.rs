//! Losses of the refinement (Eqs. 18–20) and their parts, generic over the float type; reusable
//! without the rest of the crate.
//!
//! Everywhere: images are interleaved `[H,W,C]`, row-major; a gradient has the shape of what it is
//! the gradient of; values are **means** over all pixels and channels of the whole image, as 3DGS's
//! losses are (the paper writes norms).

mod l1;
mod objective;

pub use l1::masked_l1;
pub use objective::{LossParts, LossWeights, Objective, Shape, Targets};
