//! [`FrameError`]: errors of reading a still frame.

use crate::ply::PlyError;
use thiserror::Error;

/// Error of reading a still frame.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FrameError {
    /// A PLY file that is malformed or does not contain Gaussians.
    #[error(transparent)]
    Ply(#[from] PlyError),
    /// Not a supported format.
    #[error(
        "not a splat file but {found}; expected a 3DGS PLY, a compressed PLY, .splat, .spz, .sog or .glb"
    )]
    Unknown {
        /// Format or content found instead.
        found: String,
    },
    /// An unsupported version.
    #[error("{format} version {found}, expected {expected}; {next}")]
    Version {
        /// Name of the format.
        format: &'static str,
        /// Version found.
        found: u32,
        /// Supported versions.
        expected: &'static str,
        /// Next step.
        next: &'static str,
    },
    /// The data end early.
    #[error(
        "truncated {format}: {part} needs {expected} bytes, found {found}; the file is incomplete, copy or export it again"
    )]
    Truncated {
        /// Name of the format.
        format: &'static str,
        /// Name of the part.
        part: &'static str,
        /// Bytes needed.
        expected: u128,
        /// Bytes found.
        found: u128,
    },
    /// The data are inconsistent with the format.
    #[error("damaged {format}: {what}")]
    Damaged {
        /// Name of the format.
        format: &'static str,
        /// Found and expected value.
        what: String,
    },
    /// A dynamic scene instead of a frame.
    #[error(
        "is a dynamic scene ({what}), expected one frame; give it as the scene, or write a frame \
        of it with `c4d freeze`"
    )]
    Moving {
        /// Method of the scene.
        what: &'static str,
    },
    /// No rows.
    #[error("the {format} contains no Gaussians; export it again without removing everything")]
    Empty {
        /// Name of the format.
        format: &'static str,
    },
}

impl FrameError {
    pub(crate) fn damaged(format: &'static str, what: impl Into<String>) -> Self {
        Self::Damaged { format, what: what.into() }
    }
}
