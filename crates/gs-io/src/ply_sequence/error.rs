//! [`SequenceError`]: errors of reading a sequence of frames.

use thiserror::Error;

/// Error of reading a sequence of frames, in addition to those of single frames.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SequenceError {
    /// Fewer than two frames.
    #[error(
        "contains {found} numbered frames, a sequence needs at least 2 (frame_00000.ply, \
        frame_00001.ply, …)"
    )]
    TooShort {
        /// Number of frames.
        found: usize,
    },
    /// Two files for one frame.
    #[error("has two files for frame {number}: {first} and {second}; keep one")]
    Duplicate {
        /// Number of the frame.
        number: u64,
        /// Names of the files.
        first: String,
        /// The other one.
        second: String,
    },
    /// A frame is missing.
    #[error(
        "has no frame between {first} and {second}, although the others are {step} apart; copy the missing files or renumber"
    )]
    Missing {
        /// Name of the file before it.
        first: String,
        /// Name of the file after it.
        second: String,
        /// Difference of the other numbers.
        step: u64,
    },
    /// A frame has other rows than the first one.
    #[error(
        "has {found} Gaussians of SH degree {degree}, but {first} has {expected} of degree \
        {first_degree}; all frames of a sequence must have the same rows"
    )]
    Rows {
        /// Rows of the frame.
        found: u64,
        /// Its SH degree.
        degree: usize,
        /// Name of the first frame.
        first: String,
        /// Rows of the first frame.
        expected: u64,
        /// SH degree of the first frame.
        first_degree: usize,
    },
    /// A frame was replaced after the sequence was opened.
    #[error(
        "now has {found} Gaussians of SH degree {degree}, but had {expected} of degree \
        {first_degree} when the sequence was opened"
    )]
    Changed {
        /// Rows now.
        found: usize,
        /// SH degree now.
        degree: usize,
        /// Rows at opening.
        expected: usize,
        /// SH degree at opening.
        first_degree: usize,
    },
    /// The zip archive, or an entry of it, cannot be read.
    #[error("{0}")]
    Archive(String),
    /// A frame is an empty file.
    #[error("is empty")]
    Empty,
}
