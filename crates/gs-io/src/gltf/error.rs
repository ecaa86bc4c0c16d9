//! [`GltfError`]: errors of reading a glTF frame.

use crate::spz::SpzError;
use thiserror::Error;

/// Error of reading a glTF frame.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GltfError {
    /// An unsupported version.
    #[error("glTF version {found}, expected 2; export it again from a current tool")]
    Version {
        /// Version found.
        found: u32,
    },
    /// The data end early.
    #[error(
        "truncated glTF: {part} needs {expected} bytes, found {found}; the file is incomplete, copy or export it again"
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
    #[error("damaged glTF: {0}")]
    Damaged(String),
    /// No rows.
    #[error("the glTF contains no Gaussians; export it again with at least one splat")]
    Empty,
    /// No splats in the default scene.
    #[error("found {found}")]
    NoSplats {
        /// Content found instead.
        found: &'static str,
    },
    /// Embedded SPZ is malformed.
    #[error(transparent)]
    Spz(#[from] SpzError),
}

impl GltfError {
    pub(super) fn damaged(what: impl Into<String>) -> Self {
        Self::Damaged(what.into())
    }
}
