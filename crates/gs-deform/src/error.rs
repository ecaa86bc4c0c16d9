//! Errors of building and evaluating deformation fields.

use gs_core::SplatsError;
use thiserror::Error;

/// A deformation field that cannot be built or evaluated.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FieldError {
    /// A tensor's shape does not match the others.
    #[error("deformation field: `{tensor}` has shape {found:?}, expected {expected}")]
    Shape {
        /// Name of the tensor.
        tensor: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape expected.
        expected: String,
    },
    /// A tensor used in the evaluation contains NaN or infinity.
    #[error("deformation field: `{tensor}` holds NaN or infinite values, expected finite weights")]
    NotFinite {
        /// Name of the tensor.
        tensor: String,
    },
    /// The box that normalises the coordinates is empty along an axis.
    #[error(
        "deformation field: the box has corners {maximum:?} and {minimum:?}, expected two different finite values on every axis"
    )]
    Box {
        /// Row 0 of the stored box, the maximum corner.
        maximum: [f32; 3],
        /// Row 1 of the stored box, the minimum corner.
        minimum: [f32; 3],
    },
    /// The reference implementation cannot evaluate this network either.
    #[error("deformation field: {0}")]
    Unsupported(String),
    /// The time is not finite.
    #[error("deformation field: time {0} is not finite")]
    Time(f32),
    /// The canonical splats are malformed.
    #[error(transparent)]
    Splats(#[from] SplatsError),
}
