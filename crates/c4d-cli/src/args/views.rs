//! Options for viewpoints: views of a data set, how they are read, the upward direction.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// Views of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SplitArg {
    /// Training views
    Train,
    /// Held-out views
    Test,
    /// The third list of D-NeRF data sets
    Val,
    /// Every view
    All,
    /// The camera path of the reference's videos: an orbit or a spiral
    Path,
}

/// How the cameras of a data set are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CamerasAs {
    /// As used in training by 4DGaussians and Swift4D
    Trained,
    /// As stored in the files: individual principal points, full sizes, frame i of n at i/(n−1)
    Stored,
}

/// Axes of a file whose format does not fix them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AxesArg {
    /// x right, y down, z front, as in 3DGS PLYs: splat-transform 3, gsply
    #[value(alias = "rdf")]
    Ply,
    /// x right, y up, z back: the SPZ specification, three.js
    Rub,
    /// x left, y up, z front: the glTF specification
    Luf,
}

impl AxesArg {
    pub(crate) fn axes(self) -> gs_io::Axes {
        match self {
            Self::Ply => gs_io::Axes::PLY,
            Self::Rub => gs_io::Axes::RUB,
            Self::Luf => gs_io::Axes::LUF,
        }
    }
}

/// The world's upward direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
pub(crate) enum Up {
    /// +x
    X,
    /// +y
    Y,
    /// +z
    Z,
    /// −x
    #[value(name = "-x")]
    NegX,
    /// −y, usual for captured scenes
    #[value(name = "-y")]
    NegY,
    /// −z
    #[value(name = "-z")]
    NegZ,
}

impl Up {
    /// Unit vector, world frame.
    pub(crate) fn vector(self) -> [f64; 3] {
        match self {
            Self::X => [1.0, 0.0, 0.0],
            Self::Y => [0.0, 1.0, 0.0],
            Self::Z => [0.0, 0.0, 1.0],
            Self::NegX => [-1.0, 0.0, 0.0],
            Self::NegY => [0.0, -1.0, 0.0],
            Self::NegZ => [0.0, 0.0, -1.0],
        }
    }
}
