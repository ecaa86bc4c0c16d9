//! Fits Gaussian splats to edited pictures of them.
//!
//! Pictures of a scene are rendered, edited with anything (an image editor, a diffusion model, a
//! phone), and given back. [`fit()`] finds what was edited, selects the splats that are mainly seen
//! there, and fits their parameters to the pictures: Adam on means, quaternions, scales, opacities
//! and harmonics, with `0.8·L1 + 0.2·D-SSIM` as 3DGS trains, splats added where detail is asked for
//! and removed where the pictures show what lies behind.
//!
//! Promises: splats that are not selected stay as they are, bit for bit and in order; new ones come
//! last. Pictures without a difference give the start back. The same inputs and seed give the same
//! bits on a deterministic rasteriser, for any number of threads and interruptions. Works with any
//! [`gs_core::Rasterizer`].
//!
//! [`Adam`] and the parts ([`mask`], [`votes`], [`loss`]) are usable alone.
//!
//! Conventions: images row-major, channels innermost, values 0 to 1; pixel centres at
//! half-integers; losses are means over the whole image.
//!
//! Deliberately absent: files, GPU code, motion, networks.

mod adam;
mod alignment;
mod checkpoint;
mod error;
mod fingerprint;
mod fit;
pub mod loss;
pub mod mask;
mod optimizer;
mod options;
mod report;
mod state;
mod view;
pub mod votes;
mod working;

pub use adam::Adam;
pub use error::FitError;
pub use fit::{Fitted, fit};
pub use options::{FitOptions, FitRates};
pub use report::{FitReport, PoorlySeen};
pub use state::{FitObserver, FitPreview, FitProgress, FitState, NoObserver};
pub use view::EditedPicture;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
