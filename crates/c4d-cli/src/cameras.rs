//! Cameras given by the user: a data set, one of its camera files, or a model folder.

use crate::args::{CamerasAs, SplitArg};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::placement;
use crate::scene::{self, LoadedScene};
use gs_core::Camera;
use gs_io::cameras::{self, CameraSet, Reading, Split};
use std::path::Path;

/// Number of names listed if one is not found.
const SHOWN: usize = 12;

/// How the cameras of a scene's data set are read: as in its training, if that is known.
fn reading(requested: Option<CamerasAs>, opened: &LoadedScene) -> Reading {
    // The source of a run is among its roots.
    let trained = requested.map_or_else(
        || opened.roots.iter().any(|root| is_model(root)),
        |requested| requested == CamerasAs::Trained,
    );
    if trained { Reading::Trained } else { Reading::Stored }
}

fn is_model(root: &Path) -> bool {
    gs_io::detect(root).is_ok_and(|kind| kind.is_trained())
}

/// Reads the cameras for views of `opened` and reports the assumptions. Their near
/// plane is that of the reference if they are read as in a model's training;
/// otherwise it is derived from the scene before the edit.
pub(crate) fn open(
    path: &Path,
    requested: Option<CamerasAs>,
    opened: &LoadedScene,
    console: &Console,
) -> Outcome<CameraSet> {
    let reading = reading(requested, opened);
    let mut set = cameras::open(path, reading).map_err(|error| scene::bad_input(&error))?;
    if reading == Reading::Stored {
        let extent = placement::of_scene(opened)?;
        placement::warn_if_coarse(&extent, console);
        let near = extent.near_plane();
        let views = set.views.iter_mut().map(|view| &mut view.camera);
        for camera in views.chain(&mut set.video) {
            camera.near = near;
        }
    }
    console.detail(format!("{}: {}, {} views", path.display(), set.format, set.views.len()));
    for note in &set.notes {
        console.note(format!("cameras: {note}"));
    }
    Ok(set)
}

/// Reads the cameras of a data set, one of its files, or a model folder; with `trained`, as in
/// training by 4DGaussians and Swift4D, else as stored.
///
/// # Errors
/// If the path does not exist or contains no cameras.
pub fn open_cameras(path: &Path, trained: bool) -> Outcome<CameraSet> {
    if !path.exists() {
        return Err(Failure::bad_input(format!("{} does not exist", path.display()))
            .next("Specify a data set, a cameras.json, or a model folder."));
    }
    let reading = if trained { Reading::Trained } else { Reading::Stored };
    cameras::open(path, reading).map_err(|error| scene::bad_input(&error))
}

/// The cameras of a split; by default the held-out ones, if the data set has any.
pub(crate) fn of_split(set: &CameraSet, requested: Option<SplitArg>) -> Outcome<Vec<Camera>> {
    let all = || set.views.iter().map(|view| view.camera.clone()).collect::<Vec<_>>();
    let of = |split| set.split(split).cloned().collect::<Vec<_>>();
    let chosen = match requested {
        Some(SplitArg::All) => all(),
        Some(SplitArg::Train) => of(Split::Train),
        Some(SplitArg::Test) => of(Split::Test),
        Some(SplitArg::Val) => of(Split::Val),
        Some(SplitArg::Path) => set.video.clone(),
        None => match of(Split::Test) {
            held_out if held_out.is_empty() => all(),
            held_out => held_out,
        },
    };
    if !chosen.is_empty() {
        return Ok(chosen);
    }
    let counts = [("train", Split::Train), ("test", Split::Test), ("val", Split::Val)]
        .map(|(name, split)| format!("{name} {}", set.split(split).count()));
    Err(Failure::usage(format!("{} has no such views", set.path.display())).next(format!(
        "Its views: {}, all {}, path {}. Choose with --split.",
        counts.join(", "),
        set.views.len(),
        set.video.len()
    )))
}

/// Cameras by name, by the camera's part of a name (`cam00` of `cam00/0007`), or by index.
pub(crate) fn by_name(cameras: &[Camera], wanted: &[String], shown: &str) -> Outcome<Vec<Camera>> {
    let mut chosen = Vec::new();
    for name in wanted {
        let of_rig = |camera: &&Camera| {
            camera.name == *name
                || camera.name.strip_prefix(name.as_str()).is_some_and(|rest| rest.starts_with('/'))
        };
        let before = chosen.len();
        chosen.extend(cameras.iter().filter(of_rig).cloned());
        if chosen.len() == before {
            chosen.extend(name.parse().ok().and_then(|index: usize| cameras.get(index)).cloned());
        }
        if chosen.len() == before {
            let mut names: Vec<String> = cameras::distinct_cameras(cameras.iter())
                .into_iter()
                .map(|camera| camera.name)
                .collect();
            let more = names.len().saturating_sub(SHOWN);
            names.truncate(SHOWN);
            if more > 0 {
                names.push(format!("{more} more"));
            }
            return Err(Failure::usage(format!("--views {name}: no such view in {shown}")).next(
                format!("Views: {} (or indices 0 to {}).", names.join(", "), cameras.len() - 1),
            ));
        }
    }
    Ok(chosen)
}

/// The times of the cameras, if all have one.
pub(crate) fn own_times(cameras: &[Camera]) -> Option<Vec<f32>> {
    cameras.iter().map(|camera| camera.time).collect()
}

/// At most `limit` cameras, evenly spaced.
pub(crate) fn thinned(cameras: Vec<Camera>, limit: usize) -> Vec<Camera> {
    let count = cameras.len();
    if count <= limit {
        return cameras;
    }
    (0..limit).map(|k| cameras[k * count / limit].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig() -> Vec<Camera> {
        let camera = |k: u8, name: &str| Camera {
            name: name.to_owned(),
            ..Camera::look_at([f64::from(k), 0.0, -4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.8, 64, 48)
        };
        vec![camera(0, "cam1/a"), camera(0, "cam1/b"), camera(1, "cam10/a"), camera(2, "7")]
    }

    #[test]
    fn views_are_chosen_by_name_camera_or_index() {
        let names = |wanted: &[&str]| -> Vec<String> {
            let wanted: Vec<String> = wanted.iter().map(|&name| name.to_owned()).collect();
            by_name(&rig(), &wanted, "x").unwrap().into_iter().map(|camera| camera.name).collect()
        };
        assert_eq!(
            names(&["cam1"]),
            ["cam1/a", "cam1/b"],
            "the camera with this name, not those \
                           with this prefix"
        );
        assert_eq!(names(&["cam1/b", "2"]), ["cam1/b", "cam10/a"], "a name and an index");
        assert_eq!(names(&["7"]), ["7"], "a name before an index");
        let refused = by_name(&rig(), &["cam2".to_owned()], "x").unwrap_err();
        assert!(refused.next.unwrap().contains("cam1, cam10/a, 7"), "shows cameras");
    }

    #[test]
    fn thinning_is_even() {
        let kept = thinned(rig(), 2);
        assert_eq!([&kept[0].name, &kept[1].name], ["cam1/a", "cam10/a"], "first and middle");
        assert_eq!(thinned(rig(), 9).len(), 4, "all");
    }
}
