//! Cameras and times of data sets, in every layout used to train
//! 4DGaussians, Swift4D and related methods.
//!
//! [`open`] detects the layout of a file or folder by its content and returns named
//! views with split and normalised time, as [`gs_core::Camera`]s (world to camera,
//! OpenCV's axes), with notes on its assumptions. [`Reading`] chooses between the
//! cameras used in training and those stored in the files.
//!
//! Images are never decoded; sizes come from the files or from image headers. Byte-level entry
//! points (`parse…`) accept arbitrary bytes without panicking.

pub mod colmap;
mod error;
mod format;
mod images;
mod lens;
pub mod nerfies;
mod npy;
mod number;
mod paths;
mod pose;
pub mod poses_bounds;
mod rigs;
mod set;
mod source;
pub mod transforms;

pub use error::CamerasError;
pub use format::Format;
pub(crate) use set::Unusable;
pub use set::{CameraSet, Reading, Split, View, distinct_cameras};
pub(crate) use source::data_set;
pub use source::{CameraFiles, find};

pub(crate) use images::{has_extension, pixels};
pub(crate) use number::Number;

use crate::cameras_json;
use crate::error::IoError;
use crate::fs::text;
use gs_core::Camera;
use std::path::Path;

/// Reads the cameras of a file or folder: a data set, one of its camera files, or a model folder
/// that contains cameras or names its data set.
///
/// # Errors
/// If no known layout is found, a file is missing or malformed, or no camera is valid. Invalid
/// cameras are omitted and noted.
pub fn open(path: &Path, reading: Reading) -> Result<CameraSet, IoError> {
    let source = find(path)?.ok_or_else(|| source::unknown(path))?;
    let mut set = match source.format {
        Format::CamerasJson => {
            let (cameras, notes) = cameras_json::read_file(&source.root)?;
            CameraSet {
                format: Format::CamerasJson,
                path: source.root.clone(),
                views: cameras.into_iter().map(unlisted).collect(),
                video: Vec::new(),
                notes,
            }
        }
        Format::Transforms => transforms::open(&source.root, source.file.as_deref(), reading)?,
        Format::Nerfies => nerfies::open(&source.root, reading)?,
        Format::PosesBounds => poses_bounds::open(&source.root, &source.poses_file(), reading)?,
        Format::Colmap => colmap::open(&source.root, reading)?,
        Format::FrameFolders => rigs::open_frame_folders(&source.root, reading)?,
        Format::MultiView => rigs::open_multi_view(&source.root, reading)?,
    };
    set.leave_out_unusable().map_err(IoError::format(&source.root))?;
    if let Some(via) = source.via {
        set.notes.insert(0, via);
    }
    Ok(set)
}

fn unlisted(camera: Camera) -> View {
    View { camera, split: Split::None }
}

/// Cameras from the bytes of a single file, `cameras.json`, `transforms_*.json` or
/// `poses_bounds.npy`, detected by content.
///
/// # Errors
/// If the bytes are none of these or malformed, or no camera is valid.
pub fn from_slice(bytes: &[u8], reading: Reading) -> Result<Vec<Camera>, CamerasError> {
    if npy::is_npy(bytes) {
        return poses_bounds::cameras(&poses_bounds::parse(bytes)?, reading);
    }
    match text::utf8(bytes).trim_ascii_start().first() {
        Some(b'[') => cameras_json::parse(bytes).map(|(cameras, _)| cameras),
        Some(b'{') => {
            let file = transforms::parse(bytes)?;
            let max_time = file.max_time();
            file.cameras(reading, max_time)
        }
        _ => Err(CamerasError::malformed(
            "the start",
            "cameras.json, a transforms file or poses_bounds.npy",
            "other bytes",
        )),
    }
}
