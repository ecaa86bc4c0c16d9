//! [`GsplatError`]: errors of reading a checkpoint of gsplat.

use crate::pth::{LayersError, PthError};
use thiserror::Error;

/// Error of reading a checkpoint of gsplat.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GsplatError {
    /// The PyTorch file is malformed.
    #[error("{0}")]
    Pth(#[from] PthError),
    /// A tensor is missing or has a different shape.
    #[error("{0}")]
    Tensors(#[from] LayersError),
    /// `means` has a different shape.
    #[error("`means` has shape {shape:?}, expected [splats, 3]")]
    Means {
        /// Its shape.
        shape: Vec<usize>,
    },
    /// `shN` has a different shape.
    #[error(
        "`shN` has shape {shape:?}, expected [{rows}, K, 3] with K = 0, 3, 8 or 15 (SH degree 0 to 3)"
    )]
    Harmonics {
        /// Its shape.
        shape: Vec<usize>,
        /// Number of splats.
        rows: usize,
    },
    /// Colours other than spherical harmonics.
    #[error(
        "contains `{name}`: colours other than spherical harmonics \
        are not supported; train with SH colours (sh0, shN)"
    )]
    Colors {
        /// Name of the parameter.
        name: &'static str,
    },
    /// No splats.
    #[error("contains no splats")]
    Empty,
    /// A dynamic scene of FreeTimeGS instead of a frame.
    #[error("is a dynamic scene (FreeTimeGS), expected one frame")]
    Moving,
}
