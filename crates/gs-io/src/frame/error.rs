//! [`FrameError`]: errors of reading a still frame.

use crate::compressed_ply::CompressedPlyError;
use crate::gltf::GltfError;
use crate::gsplat::GsplatError;
use crate::ply::PlyError;
use crate::sog::SogError;
use crate::splat_file::SplatFileError;
use crate::spz::SpzError;
use thiserror::Error;

/// Error of reading a still frame: that of its format, or a different kind of file.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum FrameError {
    /// A PLY file that is malformed or does not contain Gaussians.
    #[error(transparent)]
    Ply(#[from] PlyError),
    /// A malformed compressed PLY.
    #[error(transparent)]
    CompressedPly(#[from] CompressedPlyError),
    /// A malformed `.splat`.
    #[error(transparent)]
    Splat(#[from] SplatFileError),
    /// A malformed `.spz`.
    #[error(transparent)]
    Spz(#[from] SpzError),
    /// A malformed `.sog`.
    #[error(transparent)]
    Sog(SogError),
    /// A malformed glTF.
    #[error(transparent)]
    Gltf(GltfError),
    /// A malformed checkpoint of gsplat.
    #[error("damaged gsplat checkpoint: {0}")]
    Gsplat(GsplatError),
    /// Not a supported format.
    #[error(
        "not a splat file but {found}; expected a 3DGS PLY, a compressed PLY, .splat, .spz, .sog or .glb"
    )]
    Unknown {
        /// Format or content found instead.
        found: String,
    },
    /// A dynamic scene instead of a frame.
    #[error(
        "is a dynamic scene ({what}), expected one frame; use it as the scene, or write a frame \
        of it with `c4d freeze`"
    )]
    Moving {
        /// Method of the scene.
        what: &'static str,
    },
}

impl FrameError {
    /// Whether the file is of a version of its format that is not supported.
    pub fn is_unsupported_version(&self) -> bool {
        matches!(
            self,
            Self::Spz(SpzError::Version { .. })
                | Self::Sog(SogError::Version { .. })
                | Self::Gltf(GltfError::Version { .. } | GltfError::Spz(SpzError::Version { .. }))
        )
    }
}

impl From<SogError> for FrameError {
    fn from(error: SogError) -> Self {
        match error {
            SogError::Timed => Self::Moving { what: "a .tsog clip" },
            error => Self::Sog(error),
        }
    }
}

impl From<GltfError> for FrameError {
    fn from(error: GltfError) -> Self {
        match error {
            GltfError::NoSplats { found } => Self::Unknown { found: found.to_owned() },
            error => Self::Gltf(error),
        }
    }
}

impl From<GsplatError> for FrameError {
    fn from(error: GsplatError) -> Self {
        match error {
            GsplatError::Moving => Self::Moving { what: "FreeTimeGS" },
            error => Self::Gsplat(error),
        }
    }
}
