//! [`SceneKind`]: the kind of a path's content.

use crate::cameras;
use crate::content::UnsupportedFormat;
use std::fmt::{self, Display};

/// Kind of a path's content.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum SceneKind {
    /// A model folder of 4DGaussians.
    Model4dgs,
    /// A model folder of Swift4D.
    Swift4d,
    /// A model folder of Deformable-3D-Gaussians, or of a method with the same format.
    Deformable3dgs,
    /// A model folder of SC-GS.
    Scgs,
    /// A model folder of Grid4D.
    Grid4d,
    /// A model folder of DASH.
    Dash,
    /// A model folder of E-D3DGS.
    Ed3dgs,
    /// `params.npz` of Dynamic 3D Gaussians, or a folder that contains it.
    Dynamic3dgs,
    /// A PLY of Spacetime Gaussians, or a model folder with one.
    Spacetime,
    /// A PLY or checkpoint of FreeTimeGS.
    FreeTime,
    /// A checkpoint of native 4D Gaussians, or a model folder with one.
    Gaussian4d,
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
    /// A checkpoint of gsplat's trainers with one frame.
    Gsplat,
    /// A folder with a frame written by an editor.
    EditorFolder,
    /// A PLY file of a different kind, with the reason why it is not a Gaussian scene.
    OtherPly(String),
    /// A `.splatv` file: splats that move along cubic polynomials of time.
    Splatv,
    /// A `.splat4d` clip.
    Splat4d,
    /// A `.4dgs` container.
    Fourdgs,
    /// A `.tsog` archive.
    Tsog,
    /// The output folder of an earlier run.
    RunFolder,
    /// Cameras of a data set, without splats.
    Cameras(cameras::Format),
    /// A file of a known but unsupported format.
    Unsupported(UnsupportedFormat),
    /// Unknown content.
    Unknown {
        /// Entries or bytes found.
        found: Vec<String>,
    },
}

impl Display for SceneKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Model4dgs => f.write_str("4DGaussians model folder"),
            Self::Swift4d => f.write_str("Swift4D model folder"),
            Self::Deformable3dgs => f.write_str("Deformable-3D-Gaussians model folder"),
            Self::Scgs => f.write_str("SC-GS model folder"),
            Self::Grid4d => f.write_str("Grid4D model folder"),
            Self::Dash => f.write_str("DASH model folder"),
            Self::Ed3dgs => f.write_str("E-D3DGS model folder"),
            Self::Dynamic3dgs => f.write_str("Dynamic 3D Gaussians (params.npz)"),
            Self::Spacetime => f.write_str("Spacetime Gaussians"),
            Self::FreeTime => f.write_str("FreeTimeGS scene"),
            Self::Gaussian4d => f.write_str("native 4D Gaussians checkpoint"),
            Self::Model3dgs => f.write_str("3DGS model folder (static, no deformation)"),
            Self::PlySequence => f.write_str("PLY sequence"),
            Self::Ply => f.write_str("3D Gaussian PLY"),
            Self::CompressedPly => f.write_str("PlayCanvas compressed PLY"),
            Self::Splat => f.write_str(".splat frame"),
            Self::Spz => f.write_str("SPZ frame"),
            Self::Sog => f.write_str("SOG frame"),
            Self::Gltf => f.write_str("glTF frame"),
            Self::Gsplat => f.write_str("gsplat checkpoint"),
            Self::EditorFolder => f.write_str("folder with one edited frame"),
            Self::OtherPly(what) => f.write_str(what),
            Self::Splatv => f.write_str("animated splats (.splatv)"),
            Self::Splat4d => f.write_str("compressed clip (.splat4d)"),
            Self::Fourdgs => f.write_str("animated splats (.4dgs)"),
            Self::Tsog => f.write_str("animated splats (.tsog)"),
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
    /// Whether it is one frame of Gaussians, readable by
    /// [`frame::read_file`](crate::frame::read_file).
    pub fn is_frame(&self) -> bool {
        matches!(
            self,
            Self::Ply
                | Self::CompressedPly
                | Self::Splat
                | Self::Spz
                | Self::Sog
                | Self::Gltf
                | Self::Gsplat
                | Self::EditorFolder
                | Self::Model3dgs
        )
    }

    /// Whether it is a dynamic scene that [`crate::open_scene()`] reads.
    pub fn is_dynamic(&self) -> bool {
        matches!(
            self,
            Self::PlySequence | Self::Splatv | Self::Splat4d | Self::Fourdgs | Self::Tsog
        ) || self.is_trained()
    }

    /// Whether it is the output of training a dynamic scene, which has iterations and training
    /// flags.
    pub fn is_trained(&self) -> bool {
        matches!(
            self,
            Self::Model4dgs
                | Self::Swift4d
                | Self::Deformable3dgs
                | Self::Scgs
                | Self::Grid4d
                | Self::Dash
                | Self::Ed3dgs
                | Self::Dynamic3dgs
                | Self::Spacetime
                | Self::FreeTime
                | Self::Gaussian4d
        )
    }
}
