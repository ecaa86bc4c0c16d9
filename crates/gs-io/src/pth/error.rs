//! [`PthError`], [`LayersError`]: errors of reading a PyTorch file and the layers in it.

use crate::archive::ZipError;
use thiserror::Error;

/// Error of reading a PyTorch file.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PthError {
    /// A storage of the stream format of PyTorch before 1.6 is damaged.
    #[error("PyTorch file in the legacy format: {0}")]
    Legacy(String),
    /// Not an archive.
    #[error(
        "not a PyTorch file: it starts with {found}, expected a zip archive or the legacy stream"
    )]
    NotPth {
        /// First bytes, in hexadecimal.
        found: String,
    },
    /// The container is damaged.
    #[error("PyTorch file: {0}")]
    Zip(#[from] ZipError),
    /// An entry is missing from the container.
    #[error("PyTorch file: no entry `{0}` in the archive")]
    MissingEntry(String),
    /// The pickle is malformed or uses operations that checkpoints do not.
    #[error("PyTorch file: byte {at} of its pickle: {what}")]
    Pickle {
        /// Position.
        at: usize,
        /// Opcode or value found there.
        what: String,
    },
    /// A tensor does not fit its storage.
    #[error("PyTorch file: {0}")]
    Tensor(String),
    /// The root is neither a dictionary of tensors nor a tensor.
    #[error("PyTorch file: it contains {found}, expected {expected}")]
    Root {
        /// Kind of the root found.
        found: String,
        /// Kind of the root expected.
        expected: &'static str,
    },
}

/// A tensor of a readable PyTorch file is not as a network requires.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum LayersError {
    /// A tensor is missing.
    #[error("has no tensor `{name}`, but {found}")]
    Missing {
        /// Its name.
        name: String,
        /// Number and names of the tensors found.
        found: String,
    },
    /// A tensor has a different shape.
    #[error("`{name}` has shape {found:?}, expected {expected:?}")]
    Shape {
        /// Its name.
        name: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape expected.
        expected: Vec<usize>,
    },
    /// Weights and biases do not form a linear layer.
    #[error(
        "`{name}` has weights of shape {weight:?} and biases of shape {bias:?}, expected [outputs, inputs] and [outputs]"
    )]
    Linear {
        /// Name of the layer.
        name: String,
        /// Shape of the weights.
        weight: Vec<usize>,
        /// Shape of the biases.
        bias: Vec<usize>,
    },
}
