//! Errors of this crate.

/// Error of building or applying a network.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// A tensor is missing.
    #[error("the weights have no tensor `{name}`; expected {expected}")]
    Missing {
        /// Name of the tensor.
        name: String,
        /// The kind of weights expected.
        expected: &'static str,
    },
    /// A tensor does not have the expected shape.
    #[error("tensor `{name}` has shape {found:?}, expected {expected:?}")]
    Shape {
        /// Name of the tensor.
        name: String,
        /// Its shape.
        found: Vec<usize>,
        /// Expected shape; 0 stands for any size.
        expected: Vec<usize>,
    },
    /// A tensor contains values that are not finite.
    #[error("tensor `{name}` contains values that are not finite")]
    NotFinite {
        /// Name of the tensor.
        name: String,
    },
    /// A tokenizer's list of merges is malformed.
    #[error("line {line} of the merges is `{text}`, expected two symbols separated by a space")]
    Merge {
        /// Number of the line, from 1.
        line: usize,
        /// The line.
        text: String,
    },
    /// The list of merges is too short.
    #[error("{found} merges, expected at least {expected}")]
    FewMerges {
        /// Number of merges.
        found: usize,
        /// Number of merges of CLIP.
        expected: usize,
    },
    /// An image is too small, or the size of its buffer does not match.
    #[error(
        "an image of {width}×{height} pixels and {len} bytes: expected 3 bytes per pixel and sides of {min_side} or more"
    )]
    Image {
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
        /// Number of bytes.
        len: usize,
        /// Smallest side.
        min_side: usize,
    },
}
