//! [`FrameFormat`] of a still frame, and its [`Shape`].

use crate::ply::Encoding;
use std::fmt::{self, Display};

/// Format of a still frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameFormat {
    /// 3DGS PLY.
    Ply {
        /// Encoding of the data.
        encoding: Encoding,
        /// Whether the file has (unused) normals.
        normals: bool,
    },
    /// PlayCanvas compressed PLY.
    CompressedPly,
    /// `.splat`, 32 bytes per row.
    Splat,
    /// `.spz` of this version.
    Spz(u32),
    /// `.sog`, version 2.
    Sog,
    /// `.glb` or `.gltf` with `KHR_gaussian_splatting`.
    Gltf,
    /// A checkpoint of gsplat's trainers.
    Gsplat,
}

impl Display for FrameFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ply { .. } => f.write_str("3D Gaussian PLY"),
            Self::CompressedPly => f.write_str("PlayCanvas compressed PLY"),
            Self::Splat => f.write_str(".splat"),
            Self::Spz(version) => write!(f, "SPZ version {version}"),
            Self::Sog => f.write_str("SOG"),
            Self::Gltf => f.write_str("glTF"),
            Self::Gsplat => f.write_str("gsplat checkpoint"),
        }
    }
}

/// Size of a frame, from its header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Format of the file.
    pub format: FrameFormat,
    /// `N`, as declared.
    pub num_splats: u64,
    /// SH degree 0–3.
    pub sh_degree: usize,
}
