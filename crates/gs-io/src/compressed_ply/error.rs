//! [`CompressedPlyError`]: errors of reading a compressed PLY.

use crate::ply::PlyError;
use thiserror::Error;

/// Error of reading a compressed PLY.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum CompressedPlyError {
    /// The PLY around the data is malformed.
    #[error(transparent)]
    Ply(#[from] PlyError),
    /// The data are inconsistent with the format: found and expected value.
    #[error("damaged compressed PLY: {0}")]
    Damaged(String),
    /// No rows.
    #[error("the compressed PLY contains no Gaussians; export it again with at least one splat")]
    Empty,
}

impl CompressedPlyError {
    pub(super) fn damaged(what: impl Into<String>) -> Self {
        Self::Damaged(what.into())
    }
}
