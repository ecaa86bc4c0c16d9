//! [`SplatFileError`]: errors of reading a `.splat` frame.

use thiserror::Error;

/// Error of reading a `.splat` frame.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SplatFileError {
    /// The data end early.
    #[error(
        "truncated .splat: {part} needs {expected} bytes, found {found}; the file is incomplete, copy or export it again"
    )]
    Truncated {
        /// Name of the part.
        part: &'static str,
        /// Bytes needed.
        expected: u128,
        /// Bytes found.
        found: u128,
    },
    /// No rows.
    #[error("the .splat contains no Gaussians; export it again with at least one splat")]
    Empty,
}
