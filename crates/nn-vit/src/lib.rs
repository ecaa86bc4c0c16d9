//! Features of images and texts by CLIP ([`ClipNetwork`]) and DINO ([`Dino`]), and LPIPS distances
//! ([`Lpips`]), with weights provided by the user.
//!
//! The towers of CLIP and DINO are one pre-norm transformer. Sizes follow from the shapes of the
//! weights. Inputs are 8-bit images ([`Rgb8`]); [`Preprocessing`] has the conversions of published
//! metrics. Results are the same for any number of threads.
//!
//! Deliberately absent: files, downloads, training, other architectures.

mod clip;
mod convolution;
mod dino;
mod error;
mod lpips;
mod patches;
mod pil;
mod preprocess;
mod rgb8;
mod tokenizer;
mod transformer;
mod weights;

pub use clip::ClipNetwork;
pub use dino::Dino;
pub use error::NetworkError;
pub use lpips::{Lpips, LpipsBackbone};
pub use preprocess::{Planes, Preprocessing};
pub use rgb8::Rgb8;
pub use tokenizer::{CONTEXT, Tokenizer};
pub use weights::{WeightTensor, Weights};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
