//! What can be wrong with a still frame.

use crate::ply::PlyError;
use thiserror::Error;

/// Bytes that are no frame, or a damaged one.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FrameError {
    /// A PLY file that is malformed or not of Gaussians.
    #[error(transparent)]
    Ply(#[from] PlyError),
    /// None of the formats.
    #[error(
        "not a splat file but {found}; expected a 3DGS PLY, a compressed PLY, .splat, .spz, .sog or .glb"
    )]
    Unknown {
        /// What it is instead.
        found: String,
    },
    /// A version that is not read.
    #[error("{format} version {found}, expected {expected}; {next}")]
    Version {
        /// Which format.
        format: &'static str,
        /// Its version.
        found: u32,
        /// Versions that are read.
        expected: &'static str,
        /// What to do.
        next: &'static str,
    },
    /// The data end early.
    #[error(
        "truncated {format}: {part} needs {expected} bytes, found {found}; the file is incomplete, copy or export it again"
    )]
    Truncated {
        /// Which format.
        format: &'static str,
        /// Which part.
        part: &'static str,
        /// Needed.
        expected: u128,
        /// Found.
        found: u128,
    },
    /// The data contradict the format.
    #[error("damaged {format}: {what}")]
    Damaged {
        /// Which format.
        format: &'static str,
        /// What was found, and what was expected.
        what: String,
    },
    /// A scene that moves.
    #[error(
        "is a moving scene ({what}), expected one frame; give it as the scene, `c4d freeze` writes a frame of it"
    )]
    Moving {
        /// Of which method.
        what: &'static str,
    },
    /// No rows.
    #[error("the {format} contains no Gaussians; export it again without removing everything")]
    Empty {
        /// Which format.
        format: &'static str,
    },
}

impl FrameError {
    pub(crate) fn damaged(format: &'static str, what: impl Into<String>) -> Self {
        Self::Damaged { format, what: what.into() }
    }
}
