//! Views and times at which a scene is measured.

use crate::args::{SplitArg, Up};
use crate::camera_rig::CameraRig;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::scene::LoadedScene;
use crate::{cameras, frames, placement};
use gs_core::Camera;
use gs_io::cameras::distinct_cameras;
use std::path::{Path, PathBuf};

/// Number of views of the rig.
const RIG_VIEWS: usize = 2;
/// Size of the rig's images, pixels.
const RIG_SIZE: (u32, u32) = (480, 360);
/// Default maximum number of views of a data set, because each is rendered at every frame.
const MAX_VIEWS: usize = 8;

/// Flags about views and times, as given.
#[derive(Debug, Default)]
pub(crate) struct ViewFlags<'a> {
    pub(crate) cameras: Option<&'a Path>,
    pub(crate) views: &'a [String],
    pub(crate) split: Option<SplitArg>,
    pub(crate) size: Option<(u32, u32)>,
    pub(crate) up: Option<Up>,
    pub(crate) frames: Option<usize>,
    pub(crate) times: &'a [f32],
}

/// Views and times; every view is rendered at every time.
#[derive(Debug)]
pub(crate) struct Viewpoints {
    pub(crate) cameras: Vec<Camera>,
    pub(crate) times: Vec<f32>,
    /// Origin of the views, for the record: `rig` or `cameras`.
    pub(crate) origin: String,
    /// Views of the data set with their own times, used to find photographs.
    pub(crate) timed_cameras: Vec<Camera>,
    /// The file or folder, absolute.
    pub(crate) path: Option<PathBuf>,
}

/// The requested views and times. Views: those of a file or data set (the held-out ones, if there
/// are any), else two of a rig around the scene. Times: the requested ones, else those of the data
/// set, else those of the scene.
pub(crate) fn viewpoints(
    flags: &ViewFlags<'_>,
    opened: &LoadedScene,
    console: &Console,
) -> Outcome<Viewpoints> {
    let scene = opened.scene.as_ref();
    let has_times = !flags.times.is_empty() || flags.frames.is_some();
    let Some(path) = flags.cameras else {
        if !flags.views.is_empty() || flags.split.is_some() {
            return Err(Failure::usage("--views and --split select cameras of a file or data set")
                .next("Add --cameras PATH."));
        }
        let before = opened.original.as_ref().unwrap_or(&opened.scene);
        let rig = CameraRig::of_scene(before.as_ref(), flags.up.map_or(opened.up, Up::vector))
            .map_err(Failure::input)?;
        placement::warn_if_coarse(&rig.extent, console);
        return Ok(Viewpoints {
            cameras: rig.views(RIG_VIEWS, flags.size.unwrap_or(RIG_SIZE)),
            times: frames::times(scene, flags.times, flags.frames)?,
            origin: "rig".to_owned(),
            timed_cameras: Vec::new(),
            path: None,
        });
    };
    if flags.up.is_some() {
        return Err(Failure::usage(
            "--up applies to the rig only; cameras of a file have their own poses",
        ));
    }
    if !path.exists() {
        return Err(Failure::bad_input(format!(
            "--cameras {}: no such file or folder",
            path.display()
        ))
        .next(
            "Specify a data set or a cameras.json; without --cameras, a rig around the scene is used.",
        ));
    }
    let set = cameras::open(path, None, opened, console)?;
    let mut timed_cameras = if flags.views.is_empty() {
        cameras::of_split(&set, flags.split)?
    } else {
        let among = cameras::of_split(&set, Some(flags.split.unwrap_or(SplitArg::All)))?;
        cameras::by_name(&among, flags.views, &path.display().to_string())?
    };
    if let Some((width, height)) = flags.size {
        timed_cameras = timed_cameras.iter().map(|camera| camera.resized(width, height)).collect();
    }
    let mut views = distinct_cameras(timed_cameras.iter());
    let count = views.len();
    if flags.views.is_empty() && flags.split.is_none() && count > MAX_VIEWS {
        views = cameras::thinned(views, MAX_VIEWS);
        console.note(format!(
            "{MAX_VIEWS} of {count} views, evenly spaced (others: --views, --split)"
        ));
    }
    for camera in &views {
        camera.check().map_err(Failure::input)?;
    }
    let range = scene.time_range();
    let mut own: Vec<f32> = timed_cameras
        .iter()
        .filter_map(|camera| camera.time)
        .filter(|&t| range.contains(t))
        .collect();
    own.sort_unstable_by(f32::total_cmp);
    own.dedup();
    let times = if has_times || own.len() < 2 {
        frames::times(scene, flags.times, flags.frames)?
    } else {
        own
    };
    let path = std::path::absolute(path).map_err(Failure::failed)?;
    Ok(Viewpoints {
        cameras: views,
        times,
        origin: "cameras".to_owned(),
        timed_cameras,
        path: Some(path),
    })
}
