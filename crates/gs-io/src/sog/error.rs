//! [`SogError`]: errors of reading an SOG frame.

use thiserror::Error;

/// Error of reading an SOG frame.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SogError {
    /// An unsupported version.
    #[error(
        "SOG version {found}, expected 2; convert it with a current splat-transform or SuperSplat"
    )]
    Version {
        /// Version found.
        found: u32,
    },
    /// The data are inconsistent with the format: found and expected value.
    #[error("damaged SOG: {0}")]
    Damaged(String),
    /// No rows.
    #[error("the SOG contains no Gaussians; export it again with at least one splat")]
    Empty,
    /// A `.tsog` clip instead of a frame.
    #[error("is a `.tsog` clip, expected one frame")]
    Timed,
}

impl SogError {
    pub(super) fn damaged(what: impl Into<String>) -> Self {
        Self::Damaged(what.into())
    }
}
