//! [`SplatvError`]: errors of reading a `.splatv` file.

use super::row::BYTES;
use crate::repair::DamagedRows;
use thiserror::Error;

/// Error of reading a `.splatv` file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SplatvError {
    /// A different kind of file.
    #[error("is not a .splatv file: it does not begin with 0x674B")]
    Magic,
    /// The header is truncated or not JSON of this schema.
    #[error("the header of this .splatv is damaged: {0}")]
    Header(String),
    /// The last splat is incomplete.
    #[error(
        "ends in the middle of a splat: {found} bytes of splats, expected a multiple of {BYTES}; copy the file again"
    )]
    Truncated {
        /// Size of the splats, bytes.
        found: usize,
    },
    /// No splats.
    #[error("contains no splats")]
    Empty,
    /// Damaged rows where none are allowed.
    #[error(transparent)]
    Damaged(#[from] DamagedRows),
}
