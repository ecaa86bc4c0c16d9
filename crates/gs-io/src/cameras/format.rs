//! [`Format`]: the layouts of camera files.

use std::fmt::{self, Display};

/// Layouts of camera files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// `cameras.json` of 3DGS.
    CamerasJson,
    /// `transforms_train.json` and similar files.
    Transforms,
    /// `dataset.json`, `metadata.json`, `camera/`.
    Nerfies,
    /// `poses_bounds.npy`.
    PosesBounds,
    /// `sparse/0`.
    Colmap,
    /// `frame000000`, … with one COLMAP model.
    FrameFolders,
    /// `sparse_` and `cam01`, ….
    MultiView,
}

impl Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::CamerasJson => "cameras.json",
            Self::Transforms => "D-NeRF/Blender cameras (transforms_*.json)",
            Self::Nerfies => "HyperNeRF/Nerfies data set (dataset.json)",
            Self::PosesBounds => "DyNeRF/LLFF cameras (poses_bounds.npy)",
            Self::Colmap => "COLMAP model",
            Self::FrameFolders => "MeetRoom/VRU data set (frame folders with a COLMAP model)",
            Self::MultiView => "multiple-view data set (sparse_ and cam01, …)",
        })
    }
}
