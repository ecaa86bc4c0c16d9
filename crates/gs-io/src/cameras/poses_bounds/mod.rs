//! `poses_bounds.npy` of LLFF and DyNeRF (Neural 3D Video): one row per camera with pose, image
//! size, focal length and depth range.
//!
//! Row i belongs to the i-th of the sorted videos `cam*.mp4`, or of the frame folders
//! `cam*/images`; or, for photographs, to the i-th of the sorted `images`. Trained reading: half
//! the stored size, half the first row's focal length for all, times divided by 300 for any clip
//! length, the first camera held out.

mod row;

pub use row::{Row, parse};

use crate::cameras::colmap::share;
use crate::cameras::images::{has_extension, is_image, stem};
use crate::cameras::lens::Lens;
use crate::cameras::{CameraSet, CamerasError, Format, Reading, Split, View, paths};
use crate::error::IoError;
use crate::fs::{list_names, read_bytes};
use gs_core::Camera;
use std::path::Path;

/// Name of the file.
pub(in crate::cameras) const FILE: &str = "poses_bounds.npy";
/// The reference divides the frame index by this, and reads at most this many frames per camera.
const TRAINED_FRAMES: usize = 300;
/// Every n-th photograph is held out.
const HOLD: usize = 8;

/// One camera per row, named by its number, without a time.
///
/// # Errors
/// If a camera is invalid.
pub fn cameras(rows: &[Row], reading: Reading) -> Result<Vec<Camera>, CamerasError> {
    let camera = |(index, row): (usize, &Row)| {
        let lens = row.lens_of(&rows[0], reading);
        let camera = lens.camera(row.viewmat(), None, format!("cam{index:02}"));
        camera.check().map_err(|source| CamerasError::Camera { index, source })?;
        Ok(camera)
    };
    rows.iter().enumerate().map(camera).collect()
}

/// Cameras of a DyNeRF folder with the names of their frames.
struct CameraFrames {
    names: Vec<String>,
    frames: Vec<Vec<String>>,
}

/// Videos, else folders of frames. `None` if there are neither.
fn camera_frames(root: &Path, names: &[String]) -> Option<CameraFrames> {
    let of_kind = |keep: &dyn Fn(&String) -> bool| -> Vec<String> {
        names.iter().filter(|name| name.starts_with("cam") && keep(name)).cloned().collect()
    };
    let videos = of_kind(&|name| has_extension(name, "mp4"));
    let cameras: Vec<String> = if videos.is_empty() {
        of_kind(&|name| root.join(name).is_dir())
    } else {
        videos.iter().map(|name| stem(name).to_owned()).collect()
    };
    let frames = |camera: &String| {
        let listed = list_names(&root.join(camera).join("images")).unwrap_or_default();
        let frames = listed.into_iter().filter(|name| is_image(name));
        frames.take(TRAINED_FRAMES).collect()
    };
    let frames = cameras.iter().map(frames).collect();
    (!cameras.is_empty()).then_some(CameraFrames { names: cameras, frames })
}

/// Reads the data set of a folder.
pub(in crate::cameras) fn open(
    root: &Path,
    file: &str,
    reading: Reading,
) -> Result<CameraSet, IoError> {
    let path = root.join(file);
    let rows = parse(&read_bytes(&path)?).map_err(IoError::format(&path))?;
    let names = list_names(root)?;
    let trained = reading == Reading::Trained;
    let lens = |row: &Row| row.lens_of(&rows[0], reading);
    let mut notes = Vec::new();
    if trained {
        notes.push(format!(
            "images are {}×{}, half the stored size, with the first camera's focal length, as in training",
            rows[0].width / 2.0,
            rows[0].height / 2.0
        ));
    }
    let mut views = Vec::new();
    let single = |row: &Row, name: String| lens(row).camera(row.viewmat(), None, name);
    if let Some(rig) = camera_frames(root, &names) {
        if rig.names.len() != rows.len() {
            return Err(IoError::content(
                root,
                format!(
                    "has {} cameras (cam*.mp4 or cam*/images) but {file} has {} rows, expected \
                    one per camera; remove the videos without a row, or use the file that belongs \
                    to them",
                    rig.names.len(),
                    rows.len()
                ),
            ));
        }
        let longest = rig.frames.iter().map(Vec::len).max().unwrap_or(0);
        if longest == 0 {
            notes.push("no extracted frames (cam*/images): the cameras have no times".to_owned());
        } else if trained {
            notes.push(format!(
                "times are frame indices divided by {TRAINED_FRAMES}, as in \
                               training"
            ));
        }
        for (index, row) in rows.iter().enumerate() {
            let split = if index == 0 { Split::Test } else { Split::Train };
            let camera = single(row, rig.names[index].clone());
            if longest == 0 {
                views.push(View { camera, split });
                continue;
            }
            for (frame, image) in rig.frames[index].iter().enumerate() {
                let over = if trained { TRAINED_FRAMES } else { longest.max(2) - 1 };
                let name = format!("{}/{}", camera.name, stem(image));
                let time = Some(share(frame, over));
                views.push(View { camera: Camera { name, time, ..camera.clone() }, split });
            }
        }
    } else {
        let mut photographs = list_names(&root.join("images")).unwrap_or_default();
        photographs.retain(|name| is_image(name));
        let matched = photographs.len() == rows.len();
        notes.push(if matched {
            "photographs, not videos: the cameras have no times".to_owned()
        } else {
            format!(
                "no videos or frames next to {file}: cameras are named by their row and have no \
                times"
            )
        });
        for (index, row) in rows.iter().enumerate() {
            let name = if matched { photographs[index].clone() } else { format!("cam{index:02}") };
            let held_out = if matched { index % HOLD == 0 } else { index == 0 };
            let split = if held_out { Split::Test } else { Split::Train };
            views.push(View { camera: single(row, name), split });
        }
    }
    let video = video(&rows, lens(&rows[0]));
    Ok(CameraSet { format: Format::PosesBounds, path: root.to_owned(), views, video, notes })
}

/// The spiral of the reference's videos, with this lens.
pub(in crate::cameras) fn video(rows: &[Row], lens: Lens) -> Vec<Camera> {
    let spiral = paths::spiral(rows).into_iter().enumerate();
    let camera = |(frame, viewmat)| {
        lens.camera(viewmat, Some(share(frame, paths::SPIRAL_FRAMES)), format!("video/{frame:04}"))
    };
    spiral.map(camera).collect()
}
