//! Camera rigs with COLMAP poses and one image per camera and time: the multiple-view layout of
//! 4DGaussians, and the frame folders of MeetRoom and VRU that Swift4D reads.

use super::colmap::{Model, image_paths, model_folder, share};
use super::images::{Sizes, basename, is_image, stem};
use super::lens::{LeftOut, Lens};
use super::{CameraSet, CamerasError, Format, Reading, Split, View, poses_bounds};
use crate::error::IoError;
use crate::fs::{list_names, read_bytes};
use gs_core::{Camera, Intrinsics};
use std::path::Path;

/// Poses of the reference's video for the multiple-view layout.
const SPIRAL_FILE: &str = "poses_bounds_multipleview.npy";

/// Number of a frame folder, `frame000000`.
pub(super) fn frame_number(name: &str) -> Option<u64> {
    let digits = name.strip_prefix("frame")?;
    (!digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()))
        .then(|| digits.parse().ok())?
}

fn sized(size: Option<(u32, u32)>, lens: &Lens) -> (f64, f64) {
    size.map_or((lens.width, lens.height), |(width, height)| (width.into(), height.into()))
}

/// Frame i of `count` as a time.
fn time_of(frame: usize, count: usize, reading: Reading) -> f32 {
    match reading {
        Reading::Trained => share(frame, count),
        Reading::Stored => share(frame, count.max(2) - 1),
    }
}

/// Reads a multiple-view folder: COLMAP's `sparse_` names camera k `image<k>`, whose frames lie in
/// `cam<k>`.
pub(super) fn open_multi_view(root: &Path, reading: Reading) -> Result<CameraSet, IoError> {
    let folder = root.join("sparse_");
    let model = Model::read(&folder)?;
    // The reference uses the first camera's first parameter for all cameras and both axes.
    let shared = model.lenses.get(&1).or_else(|| model.lenses.values().next()).copied();
    let mut left_out = LeftOut::default();
    let mut sizes = Sizes::default();
    let (mut views, mut notes) = (Vec::new(), model.notes.clone());
    let mut counts = Vec::new();
    for image in &model.images {
        let (lens, viewmat) = model.view(image).map_err(IoError::format(&folder))?;
        left_out.distortion(&image.name, lens);
        let digits: String = stem(basename(&image.name))
            .chars()
            .skip_while(|c| !c.is_ascii_digit())
            .take_while(char::is_ascii_digit)
            .collect();
        let number: u32 = digits.parse().map_err(|_no_number| {
            let at = format!("image {} (`{}`)", image.id, image.name);
            let found = "no number in its name";
            IoError::format(&folder)(CamerasError::malformed(
                at,
                "a name such as image1.jpg",
                found,
            ))
        })?;
        let rig = format!("cam{number:02}");
        let mut frames = list_names(&root.join(&rig)).unwrap_or_default();
        frames.retain(|name| is_image(name));
        let size = frames.first().and_then(|first| sizes.of(&root.join(&rig).join(first)));
        let (width, height) = sized(size, lens);
        let lens = match (reading, shared) {
            (Reading::Trained, Some(shared)) => {
                left_out.principal_point(&rig, lens);
                let f = shared.intrinsics.fx;
                let intrinsics = Intrinsics { fx: f, fy: f, cx: width / 2.0, cy: height / 2.0 };
                Lens::pinhole(intrinsics, width, height)
            }
            _ => lens.resized(width, height),
        };
        counts.push(frames.len());
        let camera = lens.camera(viewmat, None, rig.clone());
        if frames.is_empty() {
            views.push((View { camera, split: Split::Train }, None));
            continue;
        }
        for (frame, file) in frames.iter().enumerate() {
            let name = format!("{rig}/{}", stem(file));
            let view = View { camera: Camera { name, ..camera.clone() }, split: Split::Train };
            views.push((view, Some(frame)));
        }
    }
    // The number of frames is that of the first folder, cam01.
    let first = views.iter().filter(|(view, _)| view.camera.name.starts_with("cam01/")).count();
    let count = if first > 0 { first } else { counts.iter().copied().max().unwrap_or(0) };
    let held_out = [0, count / 3, 2 * count / 3];
    for (view, frame) in &mut views {
        let Some(frame) = *frame else { continue };
        view.camera.time = Some(time_of(frame, count, reading));
        if held_out.contains(&frame) {
            view.split = Split::TrainAndTest;
        }
    }
    if counts.iter().all(|count| *count == 0) {
        notes.push(
            "no frames next to the poses (cam01/frame_00001.jpg): the cameras have no times"
                .to_owned(),
        );
    } else if counts.iter().any(|other| *other != count) {
        notes.push(format!(
            "cameras have {counts:?} frames; times are frame indices divided by \
                           {count}"
        ));
    } else {
        notes.push(format!("times are frame indices divided by the number of frames, {count}"));
    }
    notes.extend(left_out.notes());
    let spiral = root.join(SPIRAL_FILE);
    let video = match (spiral.is_file(), shared) {
        (true, Some(shared)) => {
            let rows =
                poses_bounds::parse(&read_bytes(&spiral)?).map_err(IoError::format(&spiral))?;
            let f = shared.intrinsics.fx;
            let intrinsics = Intrinsics { fy: f, ..shared.intrinsics };
            // COLMAP's field of view at the size of the frames.
            let lens = Lens::pinhole(intrinsics, shared.width, shared.height).centred();
            let (width, height) = views.first().map_or((lens.width, lens.height), |(view, _)| {
                (view.camera.width.into(), view.camera.height.into())
            });
            poses_bounds::video(&rows, lens.resized(width, height))
        }
        _ => Vec::new(),
    };
    let views = views.into_iter().map(|(view, _)| view).collect();
    Ok(CameraSet { format: Format::MultiView, path: root.to_owned(), views, video, notes })
}

/// Reads a folder of frame folders with one COLMAP model for all of them.
pub(super) fn open_frame_folders(root: &Path, reading: Reading) -> Result<CameraSet, IoError> {
    let mut frames: Vec<(u64, String)> = list_names(root)?
        .into_iter()
        .filter_map(|name| frame_number(&name).map(|number| (number, name)))
        .collect();
    frames.sort();
    let first = frames.first().map(|(_, name)| root.join(name)).unwrap_or_default();
    let folder = model_folder(root).or_else(|| model_folder(&first)).ok_or_else(|| {
        IoError::content(
            root,
            "has frame folders but no COLMAP model; expected sparse/0/cameras.bin",
        )
    })?;
    let model = Model::read(&folder)?;
    let mut left_out = LeftOut::default();
    let mut sizes = Sizes::default();
    let mut images: Vec<_> = model.images.iter().collect();
    // Swift4D sorts by the last two characters of the stem, the camera's number.
    images.sort_by_key(|image| {
        let stem: Vec<char> = stem(basename(&image.name)).chars().collect();
        stem[stem.len().saturating_sub(2)..].iter().collect::<String>()
    });
    let mut views = Vec::new();
    for (position, image) in images.into_iter().enumerate() {
        let (lens, viewmat) = model.view(image).map_err(IoError::format(&folder))?;
        left_out.distortion(&image.name, lens);
        let base = basename(&image.name);
        let paths = image_paths(&first.join("images"), &image.name);
        let (width, height) = sized(sizes.of_first(&paths), lens);
        let mut lens = lens.resized(width, height);
        if reading == Reading::Trained {
            left_out.principal_point(base, &lens);
            lens = lens.centred();
        }
        let camera = lens.camera(viewmat, None, String::new());
        let split = if position == 0 { Split::Test } else { Split::Train };
        for (frame, (_, folder)) in frames.iter().enumerate() {
            let name = format!("{}/{folder}", stem(base));
            let time = Some(time_of(frame, frames.len(), reading));
            views.push(View { camera: Camera { name, time, ..camera.clone() }, split });
        }
    }
    let mut notes = model.notes.clone();
    notes.extend(left_out.notes());
    notes.extend(sizes.note("COLMAP's sizes are used"));
    if reading == Reading::Trained {
        notes.push(format!(
            "times are frame indices divided by the number of frame folders, {}; Swift4D divides \
            by 300 for MeetRoom and by 20 for windows of VRU",
            frames.len()
        ));
    }
    Ok(CameraSet {
        format: Format::FrameFolders,
        path: root.to_owned(),
        views,
        video: Vec::new(),
        notes,
    })
}
