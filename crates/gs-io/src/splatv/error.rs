//! [`SplatvError`]: what is wrong with a `.splatv` file.

use super::row::BYTES;
use crate::repair::DamagedRows;
use thiserror::Error;

/// Bytes that are no `.splatv` scene.
#[derive(Debug, Error)]
pub enum SplatvError {
    /// Another kind of file.
    #[error("is not a .splatv file: it does not begin with 0x674B")]
    Magic,
    /// The header is cut off or no JSON of this schema.
    #[error("the header of this .splatv is damaged: {0}")]
    Header(String),
    /// The splats end in the middle of one.
    #[error(
        "ends in the middle of a splat: {found} bytes of splats, expected a multiple of {BYTES}; copy the file again"
    )]
    Truncated {
        /// Bytes of splats.
        found: usize,
    },
    /// No splats.
    #[error("holds no splats")]
    Empty,
    /// Damaged rows where none are allowed.
    #[error(transparent)]
    Damaged(#[from] DamagedRows),
}
