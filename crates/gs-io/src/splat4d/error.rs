//! [`Splat4dError`]: what is wrong with a `.splat4d` file.

use crate::repair::DamagedRows;
use thiserror::Error;

/// Bytes that are no `.splat4d` scene.
#[derive(Debug, Error)]
pub enum Splat4dError {
    /// Another kind of file.
    #[error("is not a .splat4d file: it does not begin with SP4D")]
    Magic,
    /// A later version of the format.
    #[error("is a .splat4d of version {found}, expected 1; export it again as version 1")]
    Version {
        /// Version of the file.
        found: u16,
    },
    /// The header is cut off, no JSON of this schema, or does not fit the file.
    #[error("the header of this .splat4d is damaged: {0}")]
    Header(String),
    /// A part ends after the end of the file.
    #[error(
        "this .splat4d is cut off: its {part} ends at byte {end}, the file at {found}; copy it again"
    )]
    Truncated {
        /// Which part.
        part: String,
        /// Where it would end.
        end: u64,
        /// Bytes of the file.
        found: usize,
    },
    /// A stream does not hold what the header says.
    #[error("this .splat4d is damaged: {0}; copy the file again")]
    Stream(String),
    /// Damaged rows where none are allowed.
    #[error(transparent)]
    Damaged(#[from] DamagedRows),
}
