//! Why a deformation field cannot be built or evaluated.

use gs_core::SplatsError;
use thiserror::Error;

/// A deformation field that cannot be built or evaluated.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FieldError {
    /// A tensor does not have the shape the others ask for.
    #[error("deformation field: `{tensor}` has shape {found:?}, expected {expected}")]
    Shape {
        /// Which tensor.
        tensor: String,
        /// Its shape.
        found: Vec<usize>,
        /// What would fit.
        expected: String,
    },
    /// A tensor that takes part in the evaluation holds NaN or infinity.
    #[error("deformation field: `{tensor}` holds NaN or infinite values, expected finite weights")]
    NotFinite {
        /// Which tensor.
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
    /// The time is not a number.
    #[error("deformation field: time {0} is not finite")]
    Time(f32),
    /// The canonical splats are malformed.
    #[error(transparent)]
    Splats(#[from] SplatsError),
}
