//! [`TsogError`]: errors of reading a `.tsog` archive.

use thiserror::Error;

/// Error of reading a `.tsog` archive.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TsogError {
    /// The archive or a plane is damaged.
    #[error("is a damaged .tsog: {0}; copy or export it again")]
    Damaged(String),
    /// `meta.json` is malformed, or of a different version, profile or timeline.
    #[error("{0}")]
    Meta(String),
}
