//! [`Grid4dError`]: errors of reading a network of Grid4D or DASH.

use crate::pth::LayersError;
use gs_deform::FieldError;
use thiserror::Error;

/// Error of reading a network of Grid4D or DASH.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Grid4dError {
    /// The entries of a grid have a different shape.
    #[error("`{name}` has shape {shape:?}, expected [entries, channels]")]
    Embeddings {
        /// Name of the tensor.
        name: String,
        /// Its shape.
        shape: Vec<usize>,
    },
    /// The size of the cube covered by the grids is not stated.
    #[error(
        "cannot be evaluated: the grid_args of cfg_args have no `bound`, half the side of the \
        cube covered by the grids; copy cfg_args from the machine that trained the model, or pass \
        --set bound=… (1.6 for D-NeRF, 1 for DASH)"
    )]
    Bound,
    /// The factor of positions is not one or three numbers.
    #[error("cfg_args has a scale_xyz that is neither a number nor three")]
    Scale,
    /// A tensor is missing or has a different shape.
    #[error("{0}")]
    Layers(#[from] LayersError),
    /// The tensors do not form a deformation field.
    #[error("{0}")]
    Field(#[from] FieldError),
}
