//! [`Dynamic3dgsError`]: errors of reading a `params.npz`.

use thiserror::Error;

/// Error of reading a `params.npz`.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Dynamic3dgsError {
    /// Not a NumPy archive, or damaged.
    #[error("is not a NumPy archive, or is damaged: {0}; copy the file again")]
    Archive(String),
    /// An array is missing.
    #[error(
        "has no array `{name}`, but {found}; expected the params.npz that training of Dynamic 3D Gaussians writes"
    )]
    Missing {
        /// Its name.
        name: String,
        /// Names of the arrays found.
        found: String,
    },
    /// An array cannot be read.
    #[error("its array `{name}` {what}")]
    Array {
        /// Its name.
        name: String,
        /// Found and expected value, to complete a sentence.
        what: String,
    },
    /// An entry of the archive cannot be read.
    #[error("{0}")]
    Entry(String),
    /// An array has a different shape.
    #[error("`{name}` has shape {found:?}, expected {expected}")]
    Shape {
        /// Its name.
        name: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape expected.
        expected: String,
    },
    /// No frames or no splats.
    #[error("`means3D` has shape {shape:?}: no frames or no splats")]
    Empty {
        /// Shape of `means3D`.
        shape: Vec<usize>,
    },
}
