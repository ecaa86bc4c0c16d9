//! [`CameraSet`]: the views of a data set, by name, split and time.

use super::pose::same_view;
use super::{CamerasError, Format};
use gs_core::Camera;
use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;

/// Part of a data set to which a view belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// Training view.
    Train,
    /// Held-out test view.
    Test,
    /// Used for training and for evaluation (multi-view data sets).
    TrainAndTest,
    /// The third list of D-NeRF data sets.
    Val,
    /// Not in any list of the data set, or the data set has no lists.
    None,
}

impl Split {
    /// Whether views of this split are among those of `wanted`.
    pub fn includes(self, wanted: Self) -> bool {
        self == wanted || self == Self::TrainAndTest && matches!(wanted, Self::Train | Self::Test)
    }
}

/// One image of a data set, as a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// World-to-camera pose with OpenCV's axes, pinhole, image size,
    /// normalised time if the data set has one, and name.
    pub camera: Camera,
    /// Split of the view.
    pub split: Split,
}

/// How views are derived from the files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Reading {
    /// As in the data loaders of 4DGaussians and Swift4D, so that their models are rendered as they
    /// were trained: their image sizes, centred principal points, shared focal lengths, times
    /// divided by the data set's constant, and their sign error in D-NeRF translations.
    #[default]
    Trained,
    /// As stored in the files: individual focal lengths and principal points,
    /// full image sizes, and frame i of n at i/(n−1).
    Stored,
}

/// The views of a data set.
#[derive(Debug, Clone)]
pub struct CameraSet {
    /// Layout from which it was read.
    pub format: Format,
    /// The file or folder of the data set.
    pub path: PathBuf,
    /// All views, in the order of the data set.
    pub views: Vec<View>,
    /// The camera path of the reference's videos, with times; empty for data sets without one.
    pub video: Vec<Camera>,
    /// Assumptions, omissions and missing files, one sentence each.
    pub notes: Vec<String>,
}

impl CameraSet {
    /// Cameras of one split, in order.
    pub fn split(&self, wanted: Split) -> impl Iterator<Item = &Camera> {
        self.views.iter().filter(move |view| view.split.includes(wanted)).map(|view| &view.camera)
    }

    /// The distinct cameras: views that differ only in time are merged into one without a time,
    /// named by the common part of their names.
    pub fn distinct_cameras(&self) -> Vec<Camera> {
        distinct_cameras(self.views.iter().map(|view| &view.camera))
    }

    /// Distinct times, ascending; empty if the data set has none.
    pub fn times(&self) -> Vec<f32> {
        let mut times: Vec<f32> = self.views.iter().filter_map(|view| view.camera.time).collect();
        times.sort_by(f32::total_cmp);
        times.dedup();
        times
    }

    /// Distinct image sizes, pixels.
    pub fn sizes(&self) -> BTreeSet<(u32, u32)> {
        self.views.iter().map(|view| (view.camera.width, view.camera.height)).collect()
    }

    /// Omits invalid cameras and notes the first reason, which is the error if none is left.
    pub(super) fn leave_out_unusable(&mut self) -> Result<(), CamerasError> {
        let mut unusable = Unusable::default();
        let mut index = 0;
        self.views.retain(|view| {
            let checked = check(index, &view.camera);
            index += 1;
            checked.map_err(|error| unusable.add(error)).is_ok()
        });
        self.notes.extend(unusable.note(self.views.len())?);
        if self.views.is_empty() {
            return Err(CamerasError::Empty);
        }
        if let Err(error) = check_all(self.video.iter()) {
            self.notes.push(format!("the camera path of videos is omitted: {error}"));
            self.video.clear();
        }
        Ok(())
    }
}

/// Number of unusable views of a data set, and the first reason.
#[derive(Debug, Default)]
pub(crate) struct Unusable {
    count: usize,
    first: Option<CamerasError>,
}

impl Unusable {
    pub(crate) fn add(&mut self, error: CamerasError) {
        self.count += 1;
        self.first.get_or_insert(error);
    }

    /// The note on them, given `usable` other views; if there are
    /// none, the first reason is the error.
    pub(crate) fn note(self, usable: usize) -> Result<Option<String>, CamerasError> {
        match self.first {
            Some(error) if usable == 0 => Err(error),
            first => Ok(first.map(|error| {
                format!("{} of {} views are omitted: {error}", self.count, self.count + usable)
            })),
        }
    }
}

/// Rejects an invalid camera or time.
fn check(index: usize, camera: &Camera) -> Result<(), CamerasError> {
    camera.check().map_err(|source| CamerasError::Camera { index, source })?;
    if let Some(time) = camera.time.filter(|time| !time.is_finite()) {
        let at = format!("entry {index} (`{}`)", camera.name);
        return Err(CamerasError::malformed(at, "a finite time", time));
    }
    Ok(())
}

/// Rejects invalid cameras and times.
pub(super) fn check_all<'a>(cameras: impl Iterator<Item = &'a Camera>) -> Result<(), CamerasError> {
    cameras.enumerate().try_for_each(|(index, camera)| check(index, camera))
}

/// Distinct cameras in order of appearance; see [`CameraSet::distinct_cameras`].
pub fn distinct_cameras<'a>(cameras: impl Iterator<Item = &'a Camera>) -> Vec<Camera> {
    let mut found: Vec<Camera> = Vec::new();
    let mut by_pose: HashMap<[u64; 3], Vec<usize>> = HashMap::new();
    for camera in cameras {
        let key = [0, 1, 2].map(|i| camera.viewmat[i][3].to_bits());
        let known = by_pose.entry(key).or_default();
        if let Some(&index) = known.iter().find(|&&index| same_view(&found[index], camera)) {
            // The common folder of the names: `cam00` of `cam00/0000` and `cam00/0001`.
            let rig = |name: &str| name.rsplit_once('/').map(|(rig, _)| rig.len());
            let name = &mut found[index].name;
            if let (Some(end), Some(known_end)) = (rig(&camera.name), rig(name))
                && camera.name[..end] == name[..known_end]
            {
                name.truncate(known_end);
            }
        } else {
            known.push(found.len());
            found.push(Camera { time: None, ..camera.clone() });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_of_one_camera_are_merged() {
        let seen = |x: f64, name: &str, time: f32| {
            let mut camera =
                Camera::look_at([x, 0.0, -4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.8, 64, 48);
            name.clone_into(&mut camera.name);
            camera.time = Some(time);
            camera
        };
        let cameras = [
            seen(0.0, "cam00/0000", 0.0),
            seen(1.0, "cam01/0000", 0.0),
            seen(0.0, "cam00/0001", 0.5),
            seen(2.0, "alone/0007", 0.7),
        ];
        let found = distinct_cameras(cameras.iter());
        let names: Vec<&str> = found.iter().map(|camera| camera.name.as_str()).collect();
        assert_eq!(names, ["cam00", "cam01/0000", "alone/0007"], "shared part of the name");
        assert!(found.iter().all(|camera| camera.time.is_none()), "they have no time");
    }

    #[test]
    fn splits() {
        assert!(Split::TrainAndTest.includes(Split::Train), "both");
        assert!(Split::TrainAndTest.includes(Split::Test), "both");
        assert!(
            !Split::TrainAndTest.includes(Split::Val) && !Split::Val.includes(Split::Test),
            "no"
        );
    }
}
