//! [`PthError`]: what is wrong with a PyTorch file.

use crate::archive::ZipError;
use thiserror::Error;

/// A PyTorch file that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PthError {
    /// The stream format of PyTorch before 1.6.
    #[error(
        "PyTorch file in the legacy (non-zip) format, which is not supported; load it with torch.load and save it again with torch.save of PyTorch 1.6 or later"
    )]
    Legacy,
    /// Not an archive.
    #[error("not a PyTorch file: it starts with {found}, expected a zip archive")]
    NotPth {
        /// First bytes, in hexadecimal.
        found: String,
    },
    /// The container is broken.
    #[error("PyTorch file: {0}")]
    Zip(#[from] ZipError),
    /// The container lacks a part.
    #[error("PyTorch file: no entry `{0}` in the archive")]
    MissingEntry(String),
    /// The pickle is broken or does what a checkpoint never does.
    #[error("PyTorch file: byte {at} of its pickle: {what}")]
    Pickle {
        /// Position.
        at: usize,
        /// What was found there.
        what: String,
    },
    /// A tensor does not fit its storage.
    #[error("PyTorch file: {0}")]
    Tensor(String),
    /// The file holds something other than tensors by name or a tensor.
    #[error("PyTorch file: it holds {found}, expected {expected}")]
    Root {
        /// What it holds.
        found: String,
        /// What was asked for.
        expected: &'static str,
    },
}
