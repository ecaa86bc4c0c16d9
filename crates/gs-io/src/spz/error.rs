//! [`SpzError`]: errors of reading an SPZ frame.

use thiserror::Error;

/// Error of reading an SPZ frame.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SpzError {
    /// An unsupported version.
    #[error(
        "SPZ version {found}, expected 2, 3 or 4; export it again from a current tool, or as a Gaussian PLY"
    )]
    Version {
        /// Version found.
        found: u32,
    },
    /// The data end early.
    #[error(
        "truncated SPZ: {part} needs {expected} bytes, found {found}; the file is incomplete, copy or export it again"
    )]
    Truncated {
        /// Name of the part.
        part: &'static str,
        /// Bytes needed.
        expected: u128,
        /// Bytes found.
        found: u128,
    },
    /// The data are inconsistent with the format: found and expected value.
    #[error("damaged SPZ: {0}")]
    Damaged(String),
    /// No rows.
    #[error("the SPZ contains no Gaussians; export it again with at least one splat")]
    Empty,
}

impl SpzError {
    pub(super) fn damaged(what: impl Into<String>) -> Self {
        Self::Damaged(what.into())
    }
}
