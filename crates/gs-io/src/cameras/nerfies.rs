//! Nerfies, HyperNeRF and DyCheck folders: `dataset.json`,
//! `metadata.json`, `scene.json`, and one file per camera.
//!
//! Both readings use the raw coordinates of the camera files: `scene.json`'s
//! scale and centre are not applied, as in training. Trained reading: images of half
//! size, each camera's focal length with the first camera's image size, centred
//! principal point. Times are `warp_id` over its maximum.

use super::colmap::share;
use super::images::Sizes;
use super::lens::{LeftOut, Lens};
use super::{CameraSet, CamerasError, Format, Number, Reading, Split, Unusable, View, pose};
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::fs::text;
use glam::{DMat3, DVec3};
use gs_core::Intrinsics;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Without lists, every fourth view is a training view, and the one midway between two is held out.
const STRIDE: usize = 4;

/// `dataset.json`: all views, and the lists that contain them.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Dataset {
    ids: Vec<String>,
    #[serde(default)]
    train_ids: Vec<String>,
    #[serde(default)]
    val_ids: Vec<String>,
}

/// An entry of `metadata.json`; `time_id` is the older name.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
struct Metadata {
    #[serde(alias = "time_id")]
    warp_id: Option<u32>,
}

/// `camera/<id>.json`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct NerfiesCamera {
    orientation: [[Number; 3]; 3],
    position: [Number; 3],
    focal_length: Number,
    principal_point: [Number; 2],
    #[serde(default = "one")]
    pixel_aspect_ratio: f64,
    #[serde(default)]
    skew: f64,
    #[serde(default)]
    radial_distortion: Vec<f64>,
    #[serde(default, alias = "tangential")]
    tangential_distortion: Vec<f64>,
    image_size: [Number; 2],
}

fn one() -> f64 {
    1.0
}

/// Parses a `dataset.json`.
///
/// # Errors
/// If it is not JSON of this form, names no views, or an id could leave the folder.
pub fn parse_dataset(bytes: &[u8]) -> Result<Dataset, CamerasError> {
    let dataset: Dataset =
        serde_json::from_slice(&text::json(bytes)).map_err(CamerasError::json("dataset.json"))?;
    if dataset.ids.is_empty() {
        return Err(CamerasError::Empty);
    }
    if let Some(id) = dataset.ids.iter().find(|id| id.contains(['/', '\\']) || id.contains("..")) {
        return Err(CamerasError::malformed("ids", "names without folders", format!("`{id}`")));
    }
    Ok(dataset)
}

/// Parses a `metadata.json` into time indices by view.
///
/// # Errors
/// If it is not JSON of this form.
pub fn parse_metadata(bytes: &[u8]) -> Result<BTreeMap<String, Option<u32>>, CamerasError> {
    let entries: BTreeMap<String, Metadata> =
        serde_json::from_slice(&text::json(bytes)).map_err(CamerasError::json("metadata.json"))?;
    Ok(entries.into_iter().map(|(id, entry)| (id, entry.warp_id)).collect())
}

/// Parses a camera file.
///
/// # Errors
/// If it is not JSON of this form.
pub fn parse_camera(bytes: &[u8]) -> Result<NerfiesCamera, CamerasError> {
    serde_json::from_slice(&text::json(bytes)).map_err(CamerasError::json("camera of Nerfies"))
}

impl NerfiesCamera {
    fn viewmat(&self) -> pose::Viewmat {
        // Rows: right, down, forward in the world.
        let orientation = self.orientation.map(|row| row.map(|value| value.0));
        let rotation = DMat3::from_cols_array_2d(&orientation).transpose();
        let position = DVec3::from(self.position.map(|value| value.0));
        pose::viewmat(rotation, rotation * -position)
    }

    fn lens(&self) -> Lens {
        let (fx, fy) = (self.focal_length.0, self.focal_length.0 * self.pixel_aspect_ratio);
        let [cx, cy] = self.principal_point.map(|value| value.0);
        let [width, height] = self.image_size.map(|value| value.0);
        let term = |list: &[f64], k: usize| list.get(k).copied().unwrap_or(0.0);
        Lens {
            radial: [0, 1, 2].map(|k| term(&self.radial_distortion, k)),
            tangential: [0, 1].map(|k| term(&self.tangential_distortion, k)),
            ..Lens::pinhole(Intrinsics { fx, fy, cx, cy }, width, height)
        }
    }
}

impl Dataset {
    /// Splits in the order of `ids`.
    fn splits(&self) -> Vec<Split> {
        if self.val_ids.is_empty() {
            // The reference's list of held-out positions omits the last one.
            let held_out = self.ids.len().div_ceil(STRIDE) - 1;
            return (0..self.ids.len())
                .map(|position| match position % STRIDE {
                    0 => Split::Train,
                    2 if position / STRIDE < held_out => Split::Test,
                    _ => Split::None,
                })
                .collect();
        }
        let train: BTreeSet<&String> = self.train_ids.iter().collect();
        let held_out: BTreeSet<&String> = self.val_ids.iter().collect();
        let split = |id: &String| match (train.contains(id), held_out.contains(id)) {
            (true, true) => Split::TrainAndTest,
            (true, false) => Split::Train,
            (false, true) => Split::Test,
            (false, false) => Split::None,
        };
        self.ids.iter().map(split).collect()
    }
}

fn parsed<T>(
    path: &Path,
    parse: impl FnOnce(&[u8]) -> Result<T, CamerasError>,
) -> Result<T, IoError> {
    parse(&read_bytes(path)?).map_err(IoError::format(path))
}

/// The camera file of a view; errors in it affect only this view.
fn read_camera(root: &Path, id: &str) -> Result<NerfiesCamera, CamerasError> {
    let path = root.join("camera").join(format!("{id}.json"));
    let unreadable =
        |what: String| CamerasError::malformed(format!("camera/{id}.json"), "a camera", what);
    match read_bytes(&path) {
        Ok(bytes) => parse_camera(&bytes).map_err(|error| unreadable(error.to_string())),
        Err(IoError::Read { source, .. }) => Err(unreadable(source.to_string())),
        Err(error) => Err(unreadable(error.to_string())),
    }
}

/// Reads the data set of a folder.
pub(super) fn open(root: &Path, reading: Reading) -> Result<CameraSet, IoError> {
    let dataset = parsed(&root.join("dataset.json"), parse_dataset)?;
    let metadata_path = root.join("metadata.json");
    let metadata = parsed(&metadata_path, parse_metadata)?;
    let warp_ids = dataset.ids.iter().map(|id| metadata.get(id).copied().flatten());
    let warp_ids: Vec<Option<u32>> = warp_ids.collect();
    let last = warp_ids.iter().flatten().copied().max().unwrap_or(0);
    let mut left_out = LeftOut::default();
    let mut sizes = Sizes::default();
    let mut first_size = None;
    let mut skewed = 0;
    let mut views = Vec::with_capacity(dataset.ids.len());
    let mut unusable = Unusable::default();
    for ((id, split), warp_id) in dataset.ids.iter().zip(dataset.splits()).zip(warp_ids) {
        let camera = match read_camera(root, id) {
            Ok(camera) if warp_id.is_some() => camera,
            Ok(_) => {
                let at = format!("`{id}` in metadata.json");
                unusable.add(CamerasError::malformed(at, "an entry with a warp_id", "none"));
                continue;
            }
            Err(error) => {
                unusable.add(error);
                continue;
            }
        };
        let mut lens = camera.lens();
        left_out.distortion(id, &lens);
        skewed += usize::from(camera.skew != 0.0);
        if reading == Reading::Trained {
            let (width, height) = *first_size.get_or_insert((lens.width, lens.height));
            let image = sizes.of(&root.join("rgb/2x").join(format!("{id}.png")));
            let (w, h) = image.map_or_else(
                || ((width / 2.0).floor(), (height / 2.0).floor()),
                |(w, h)| (f64::from(w), f64::from(h)),
            );
            left_out.principal_point(id, &lens);
            // One focal length for both axes, with the first camera's size.
            let f = camera.focal_length.0;
            let intrinsics = Intrinsics { fx: f, fy: f, cx: width / 2.0, cy: height / 2.0 };
            lens = Lens::pinhole(intrinsics, width, height).resized(w, h);
        }
        let time = warp_id.map(|warp| share(warp as usize, last as usize));
        views.push(View { camera: lens.camera(camera.viewmat(), time, id.clone()), split });
    }
    let mut notes = left_out.notes();
    notes.extend(unusable.note(views.len()).map_err(IoError::format(root))?);
    notes.extend(sizes.note("half of the size in the camera files is assumed, as in training"));
    if skewed > 0 {
        notes.push(format!("{skewed} cameras have skew, which is ignored"));
    }
    if dataset.val_ids.is_empty() {
        notes.push(
            "no val_ids: every fourth view is a training view, the views midway between are held \
            out"
            .to_owned(),
        );
    }
    notes.push(
        "world units are those of the camera files; scene.json's scale and centre are not applied, as in training"
            .to_owned(),
    );
    Ok(CameraSet {
        format: Format::Nerfies,
        path: root.to_owned(),
        views,
        video: Vec::new(),
        notes,
    })
}
