//! [`CuarError`].

use gs_core::{CameraError, RasterError, SceneError, SplatsError};
use thiserror::Error;

/// Error of a pass or of the refinement.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CuarError {
    /// The size of an argument does not match the others.
    #[error("refinement: `{what}` has {found} values, expected {expected}")]
    Shape {
        /// Name of the argument.
        what: &'static str,
        /// Number of values found.
        found: usize,
        /// Number of values expected.
        expected: usize,
    },
    /// An option or input out of range.
    #[error("refinement: {what}")]
    Input {
        /// Description, with the value found and the values expected.
        what: String,
    },
    /// The scene could not be evaluated.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The rasteriser failed.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// A camera is malformed.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Arrays of splats have inconsistent lengths.
    #[error(transparent)]
    Splats(#[from] SplatsError),
    /// A checkpoint belongs to other inputs or is damaged.
    #[error("refinement checkpoint: {what}")]
    State {
        /// Description of the mismatch.
        what: String,
    },
    /// The observer cancelled the run; its last checkpoint contains all completed steps.
    #[error("refinement: cancelled at step {step}")]
    Cancelled {
        /// Completed steps.
        step: u64,
    },
}

impl CuarError {
    pub(crate) fn input(what: impl Into<String>) -> Self {
        Self::Input { what: what.into() }
    }

    pub(crate) fn check(what: &'static str, found: usize, expected: usize) -> Result<(), Self> {
        if found == expected { Ok(()) } else { Err(Self::Shape { what, found, expected }) }
    }
}
