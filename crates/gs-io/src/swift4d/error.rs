//! [`Swift4dError`]: errors of reading a model of Swift4D.

use gs_deform::FieldError;
use thiserror::Error;

/// Error of reading a model of Swift4D.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Swift4dError {
    /// The tensors do not form its field.
    #[error("{0}")]
    Network(String),
    /// The flags of the training run are unknown, contradict the field, or cannot be evaluated.
    #[error("{0}")]
    Flags(String),
    /// The PLY has no dynamic score per splat.
    #[error(
        "has no column `{column}`, which marks the moving splats; use the file that training \
        wrote (editors drop this column)"
    )]
    NoScore {
        /// Name of the column.
        column: &'static str,
    },
    /// The tensors do not form a deformation field.
    #[error("{0}")]
    Field(#[from] FieldError),
}
