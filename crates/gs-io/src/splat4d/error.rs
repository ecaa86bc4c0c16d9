//! [`Splat4dError`]: errors of reading a `.splat4d` file.

use crate::repair::DamagedRows;
use thiserror::Error;

/// Error of reading a `.splat4d` file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Splat4dError {
    /// A different kind of file.
    #[error("is not a .splat4d file: it does not begin with SP4D")]
    Magic,
    /// A later version of the format.
    #[error("is a .splat4d of version {found}, expected 1; export it again as version 1")]
    Version {
        /// Version of the file.
        found: u16,
    },
    /// The header is truncated, not JSON of this schema, or inconsistent with the file.
    #[error("the header of this .splat4d is damaged: {0}")]
    Header(String),
    /// A part ends after the end of the file.
    #[error(
        "this .splat4d is truncated: its {part} ends at byte {end}, the file at {found}; copy it \
        again"
    )]
    Truncated {
        /// Name of the part.
        part: String,
        /// Expected end, bytes.
        end: u64,
        /// Size of the file, bytes.
        found: usize,
    },
    /// A stream is inconsistent with the header.
    #[error("this .splat4d is damaged: {0}; copy the file again")]
    Stream(String),
    /// Damaged rows where none are allowed.
    #[error(transparent)]
    Damaged(#[from] DamagedRows),
}
