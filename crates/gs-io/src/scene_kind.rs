//! [`SceneKind`]: what a path holds.

use crate::cameras;
use crate::content::UnsupportedFormat;
use std::fmt::{self, Display};

/// What a path holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SceneKind {
    /// A model folder of 4DGaussians.
    Model4dgs,
    /// A model folder of Swift4D.
    Swift4d,
    /// A model folder of plain 3DGS, whose newest save is one frame.
    Model3dgs,
    /// Numbered frames in a folder or a zip archive.
    PlySequence,
    /// A 3DGS PLY file.
    Ply,
    /// A PLY file compressed by PlayCanvas tools.
    CompressedPly,
    /// A `.splat` frame.
    Splat,
    /// An `.spz` frame.
    Spz,
    /// A `.sog` frame.
    Sog,
    /// A `.glb` or `.gltf` frame.
    Gltf,
    /// A folder in which an editor left a frame.
    EditorFolder,
    /// A PLY file of something else; why it is no Gaussian scene.
    OtherPly(String),
    /// A `.splatv` file: splats that move along cubics of time.
    Splatv,
    /// A `.splat4d` clip.
    Splat4d,
    /// The output folder of an earlier run.
    RunFolder,
    /// Cameras of a data set, without splats.
    Cameras(cameras::Format),
    /// A file that is known but not read here.
    Unsupported(UnsupportedFormat),
    /// Something else.
    Unknown {
        /// What was found there.
        found: Vec<String>,
    },
}

impl Display for SceneKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Model4dgs => f.write_str("4DGaussians model folder"),
            Self::Swift4d => f.write_str("Swift4D model folder"),
            Self::Model3dgs => f.write_str("3DGS model folder (static, no deformation)"),
            Self::PlySequence => f.write_str("PLY sequence"),
            Self::Ply => f.write_str("3D Gaussian PLY"),
            Self::CompressedPly => f.write_str("PlayCanvas compressed PLY"),
            Self::Splat => f.write_str(".splat frame"),
            Self::Spz => f.write_str("SPZ frame"),
            Self::Sog => f.write_str("SOG frame"),
            Self::Gltf => f.write_str("glTF frame"),
            Self::EditorFolder => f.write_str("folder with one edited frame"),
            Self::OtherPly(what) => f.write_str(what),
            Self::Splatv => f.write_str("animated splats (.splatv)"),
            Self::Splat4d => f.write_str("compressed clip (.splat4d)"),
            Self::RunFolder => f.write_str("run folder"),
            Self::Cameras(format) => write!(f, "{format}"),
            Self::Unsupported(format) => f.write_str(format.name),
            Self::Unknown { found } if found.is_empty() => f.write_str("unknown: an empty folder"),
            Self::Unknown { found } => {
                write!(f, "unknown: found {}", found.join(", "))
            }
        }
    }
}

impl SceneKind {
    /// Whether it is one frame of Gaussians, which [`frame::read_file`](crate::frame::read_file) reads.
    pub fn is_frame(&self) -> bool {
        matches!(
            self,
            Self::Ply
                | Self::CompressedPly
                | Self::Splat
                | Self::Spz
                | Self::Sog
                | Self::Gltf
                | Self::EditorFolder
                | Self::Model3dgs
        )
    }
}
