//! [`FreeTimeError`]: errors of reading a scene of FreeTimeGS.

use crate::gsplat::GsplatError;
use crate::pth::LayersError;
use thiserror::Error;

/// Error of reading a scene of FreeTimeGS.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum FreeTimeError {
    /// A comment of the PLY has an unsupported value.
    #[error("{0}")]
    Settings(String),
    /// The splats of a checkpoint are malformed.
    #[error("{0}")]
    Splats(#[from] GsplatError),
    /// A tensor of a checkpoint is missing or has a different shape.
    #[error("{0}")]
    Layers(#[from] LayersError),
}
