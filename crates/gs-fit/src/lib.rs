//! Fits Gaussian splats to edited pictures of them.
//!
//! Pictures of a scene are rendered and edited with any tool (an image editor, a diffusion model).
//! [`fit()`] finds the edited pixels, selects the splats that are mainly visible there, and fits
//! their parameters to the pictures: Adam on means, quaternions, scales, opacities and harmonics,
//! with the loss of 3DGS, `0.8·L1 + 0.2·D-SSIM`. Splats are added where gradients are large, and
//! removed where the pictures show the background.
//!
//! Promises: splats that are not selected keep their bits and their order; new ones come last. If
//! no picture differs from the scene, the result is the input. The same inputs and seed give the
//! same bits on a deterministic rasteriser, for any number of threads and interruptions. Works with
//! any [`gs_core::Rasterizer`].
//!
//! [`Adam`], [`mask`], [`votes`] and [`loss`] can be used alone.
//!
//! Conventions: images row-major, channels innermost, values 0 to 1; pixel centres at
//! half-integers; losses are means over the whole image.
//!
//! Deliberately absent: files, GPU code, motion, networks.

mod adam;
mod alignment;
mod carving;
mod checkpoint;
mod color_estimate;
mod error;
mod fingerprint;
mod fit;
mod frozen_geometry;
mod gamut;
pub mod loss;
pub mod mask;
mod optimizer;
mod options;
mod patch_statistics;
mod report;
mod state;
mod style;
mod subset;
mod view;
pub mod votes;
mod working;

pub use adam::Adam;
pub use error::FitError;
pub use fit::{Fitted, fit};
pub use options::{FitOptions, FitRates};
pub use report::{FitReport, PoorlySeen};
pub use state::{FitObserver, FitPreview, FitProgress, FitState, NoFitObserver};
pub use style::{StyleFit, StyleOptions, fit_style};
pub use view::EditedPicture;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
