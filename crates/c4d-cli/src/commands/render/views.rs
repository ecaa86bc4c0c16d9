//! Views of a render.

use crate::args::{Crop, RenderArgs, SplitArg};
use crate::camera_rig::{CameraRig, DEFAULT_SIZE};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::scene::LoadedScene;
use crate::{cameras, frames, placement};
use gs_core::Camera;
use std::path::Path;

/// Cameras of a render.
pub(crate) enum Views {
    /// Every camera renders every time.
    Fixed(Vec<Camera>),
    /// Camera `i` renders time `i`.
    Path(Vec<Camera>),
}

impl Views {
    pub(crate) fn cameras(&self) -> &[Camera] {
        match self {
            Self::Fixed(cameras) | Self::Path(cameras) => cameras,
        }
    }

    /// Cameras of frame `i`.
    pub(super) fn of_frame(&self, i: usize) -> &[Camera] {
        match self {
            Self::Fixed(cameras) => cameras,
            Self::Path(cameras) => &cameras[i..=i],
        }
    }
}

/// The requested cameras. `times` become those of the cameras, if
/// they have any and no others are requested.
pub(crate) fn views(
    args: &RenderArgs,
    opened: &LoadedScene,
    times: &mut Vec<f32>,
    console: &Console,
) -> Outcome<Views> {
    let size = args.size.unwrap_or(DEFAULT_SIZE);
    let rig = || -> Outcome<CameraRig> {
        // The rig frames the scene before the edit, so that a run
        // and its source have the same views.
        let scene = opened.original.as_ref().unwrap_or(&opened.scene);
        CameraRig::of_scene(scene.as_ref(), args.up.map_or(opened.up, crate::args::Up::vector))
            .map_err(Failure::input)
            .inspect(|rig| placement::warn_if_coarse(&rig.extent, console))
    };
    let from_rig = ["front", "orbit", "spiral"].contains(&args.cameras.as_str());
    let chooses = !args.views.is_empty() || args.split.is_some() || args.cameras_as.is_some();
    if from_rig && chooses {
        return Err(Failure::usage(
            "--views, --split and --cameras-as select cameras of a file or data set",
        )
        .next("Add --cameras PATH."));
    }
    if !from_rig && args.up.is_some() {
        return Err(Failure::usage(
            "--up applies to front, orbit and spiral only; other cameras have their own poses",
        )
        .next("Omit it."));
    }
    let views = match args.cameras.as_str() {
        "front" => Views::Fixed(vec![rig()?.front(size)]),
        "orbit" => Views::Path(rig()?.orbit(times.len(), size)),
        "spiral" => Views::Path(rig()?.spiral(times.len(), size)),
        named => of_files(args, opened, named, times, console)?,
    };
    match args.crop {
        Some(crop) => cropped(views, crop),
        None => Ok(views),
    }
}

/// The part of each view selected by `crop`.
pub(crate) fn cropped(
    views: Views,
    Crop { size: (width, height), origin: [x, y] }: Crop,
) -> Outcome<Views> {
    let lies_within = |camera: &Camera| x + width <= camera.width && y + height <= camera.height;
    if let Some(camera) = views.cameras().iter().find(|camera| !lies_within(camera)) {
        return Err(Failure::usage(format!(
            "--crop {width}x{height}+{x}+{y} reaches beyond the image, {}x{} pixels",
            camera.width, camera.height
        )));
    }
    let crop = |mut cameras: Vec<Camera>| {
        for camera in &mut cameras {
            camera.intrinsics.cx -= f64::from(x);
            camera.intrinsics.cy -= f64::from(y);
            (camera.width, camera.height) = (width, height);
        }
        cameras
    };
    Ok(match views {
        Views::Fixed(cameras) => Views::Fixed(crop(cameras)),
        Views::Path(cameras) => Views::Path(crop(cameras)),
    })
}

/// Cameras of a file or data set: each at its own time, or each at all
/// times if they have none or others are requested.
fn of_files(
    args: &RenderArgs,
    opened: &LoadedScene,
    named: &str,
    times: &mut Vec<f32>,
    console: &Console,
) -> Outcome<Views> {
    let path = Path::new(named);
    if !path.exists() {
        return Err(Failure::bad_input(format!("--cameras {named}: no such file or folder"))
            .next("Specify a data set, a cameras.json, or one of: front, orbit, spiral."));
    }
    let set = cameras::open(path, args.cameras_as, opened, console)?;
    let mut chosen = if args.views.is_empty() {
        cameras::of_split(&set, args.split)?
    } else {
        let among = cameras::of_split(&set, Some(args.split.unwrap_or(SplitArg::All)))?;
        cameras::by_name(&among, &args.views, named)?
    };
    if args.views.is_empty() && chosen.len() < set.views.len() && args.split.is_none() {
        console.note(format!(
            "{} held-out views of {} (others: --split, --views)",
            chosen.len(),
            set.views.len()
        ));
    }
    if let Some((width, height)) = args.size {
        chosen = chosen.iter().map(|camera| camera.resized(width, height)).collect();
    }
    let has_times = !args.times.is_empty() || args.frames.is_some();
    match cameras::own_times(&chosen).filter(|_| !has_times) {
        Some(own) => {
            let range = opened.scene.time_range();
            let count = own.len();
            chosen.retain(|camera| camera.time.is_some_and(|time| range.contains(time)));
            if chosen.is_empty() {
                frames::check(range, own[0], "the cameras' time")?;
            }
            if chosen.len() < count {
                console.warn(format!(
                    "{} of {count} views are outside the scene's times, {} to {}, and are omitted",
                    count - chosen.len(),
                    range.start,
                    range.end
                ));
            }
            *times = chosen.iter().filter_map(|camera| camera.time).collect();
            Ok(Views::Path(chosen))
        }
        None if chosen.iter().all(|camera| camera.time.is_none()) => Ok(Views::Fixed(chosen)),
        None => Ok(Views::Fixed(gs_io::cameras::distinct_cameras(chosen.iter()))),
    }
}
