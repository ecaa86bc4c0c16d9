//! [`FitError`].

use gs_core::{CameraError, RasterError, SplatsError};
use thiserror::Error;

/// Error of a fit.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FitError {
    /// A camera is invalid.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The splats' arrays have inconsistent lengths.
    #[error(transparent)]
    Splats(#[from] SplatsError),
    /// The rasteriser failed.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// There are no pictures.
    #[error("no pictures to fit")]
    NoPictures,
    /// A picture or its mask differs in size from its camera.
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
    /// Pictures differ from their originals, but no splat is mainly visible there.
    #[error(
        "the pictures differ from the scene in {pixels} pixels of {views} views, but no splat is mainly visible there"
    )]
    NothingSelected {
        /// Pixels of the masks.
        pixels: usize,
        /// Views with a mask.
        views: usize,
    },
    /// The picture of a style is too small, or has too few opaque pixels.
    #[error("the picture has too few patches of 7×7 opaque pixels")]
    SmallPicture,
    /// Nothing that is selected and visible can show the patterns of a style.
    #[error(
        "the selection has too few patches of 7×7 pixels with splats small enough to show patterns"
    )]
    BroadSplats,
    /// An option is out of range.
    #[error("{name} is {found}, expected {expected}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        found: String,
        /// Allowed values.
        expected: &'static str,
    },
    /// A state to resume from is from a different fit, or is damaged.
    #[error("cannot resume: {what}")]
    State {
        /// Description of the mismatch.
        what: String,
    },
    /// The observer cancelled the fit.
    #[error("stopped")]
    Cancelled,
}
