//! [`FitError`].

use gs_core::{CameraError, RasterError, SplatsError};
use thiserror::Error;

/// Why a fit did not happen.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FitError {
    /// A camera cannot see.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The splats' arrays disagree.
    #[error(transparent)]
    Splats(#[from] SplatsError),
    /// The rasteriser failed.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// There are no pictures.
    #[error("no pictures to fit")]
    NoPictures,
    /// A picture or its mask has another size than its camera.
    #[error("view `{name}`: the {what} is {found}, expected {expected}")]
    Size {
        /// Name of the view.
        name: String,
        /// `picture` or `mask`.
        what: &'static str,
        /// Size found.
        found: String,
        /// Size of the camera.
        expected: String,
    },
    /// Pictures differ from their originals, but no splat is mainly seen there.
    #[error(
        "the pictures differ from the scene in {pixels} pixels of {views} views, but no splat is mainly seen there"
    )]
    NothingSelected {
        /// Pixels of the masks.
        pixels: usize,
        /// Views with a mask.
        views: usize,
    },
    /// An option is out of range.
    #[error("{name} is {found}, expected {expected}")]
    Option {
        /// Its name.
        name: &'static str,
        /// Its value.
        found: String,
        /// What it may be.
        expected: &'static str,
    },
    /// A state to resume from belongs to another fit, or is damaged.
    #[error("the state to resume from does not fit: {what}")]
    State {
        /// What is wrong.
        what: String,
    },
    /// The observer asked to stop.
    #[error("stopped")]
    Cancelled,
}
