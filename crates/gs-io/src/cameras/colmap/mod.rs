//! COLMAP models, binary and text: world-to-camera quaternions and translations.
//!
//! Trained reading: views sorted by name, every eighth a test view; times by position in the file
//! *before* sorting, over the number of images; centred principal points; field of view from
//! COLMAP's image size. Stored reading: own principal points, no times.

mod binary;
mod lens_models;
mod records;
mod text;

pub use binary::{parse_cameras_bin, parse_images_bin};
pub use records::{ColmapCamera, ColmapImage};
pub use text::{parse_cameras_txt, parse_images_txt};

use super::images::{Sizes, basename};
use super::lens::{LeftOut, Lens};
use super::pose::{self, Viewmat};
use super::{CameraSet, CamerasError, Format, Reading, Split, View};
use crate::error::IoError;
use crate::fs::read_bytes;
use gs_core::Camera;
use gs_core::image_formation::NEAR_PLANE;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Every n-th view of the sorted list, from the first, is a test view.
const HOLD: usize = 8;

/// A COLMAP model: lenses by id, and images in file order. Unusable images are omitted and noted.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) lenses: BTreeMap<u32, Lens>,
    pub(super) images: Vec<ColmapImage>,
    /// Position of each image in the file, and the number of images in the file.
    positions: Vec<usize>,
    total: usize,
    pub(super) notes: Vec<String>,
}

impl Model {
    /// Reads the model of a folder, from the binary files if they exist.
    pub(super) fn read(folder: &Path) -> Result<Self, IoError> {
        let binary = ["cameras.bin", "images.bin"].map(|name| folder.join(name));
        let text = ["cameras.txt", "images.txt"].map(|name| folder.join(name));
        let (cameras, images);
        if binary.iter().all(|file| file.is_file()) {
            cameras = parsed(&binary[0], parse_cameras_bin)?;
            images = parsed(&binary[1], parse_images_bin)?;
        } else if text.iter().all(|file| file.is_file()) {
            cameras = parsed(&text[0], |bytes| parse_cameras_txt(&crate::fs::text::decode(bytes)))?;
            images = parsed(&text[1], |bytes| parse_images_txt(&crate::fs::text::decode(bytes)))?;
        } else {
            return Err(IoError::content(
                folder,
                "has no complete COLMAP model; expected cameras.bin and images.bin, or cameras.txt and images.txt. Copy the missing file",
            ));
        }
        let (mut lenses, mut unusable) = (BTreeMap::new(), BTreeMap::new());
        for camera in &cameras {
            match camera.lens() {
                Ok(lens) => drop(lenses.insert(camera.id, lens)),
                Err(error) => drop(unusable.insert(camera.id, error)),
            }
        }
        let total = images.len();
        let mut model = Self { lenses, images, positions: Vec::new(), total, notes: Vec::new() };
        model.leave_out_unusable(unusable).map_err(IoError::format(folder))?;
        Ok(model)
    }

    /// Omits images without a usable lens or pose; if none is left, the first reason is the error.
    fn leave_out_unusable(
        &mut self,
        mut unusable: BTreeMap<u32, CamerasError>,
    ) -> Result<(), CamerasError> {
        let images = std::mem::take(&mut self.images);
        let mut first = None;
        for (position, image) in images.into_iter().enumerate() {
            match self.view(&image) {
                Ok(_) => {
                    self.images.push(image);
                    self.positions.push(position);
                }
                Err(error) => {
                    let error = unusable.remove(&image.camera_id).unwrap_or(error);
                    first.get_or_insert((image.name, error));
                }
            }
        }
        match first {
            Some((_, error)) if self.images.is_empty() => Err(error),
            Some((name, error)) => {
                let (total, left_out) = (self.total, self.total - self.images.len());
                self.notes.push(format!(
                    "{left_out} of {total} images are omitted; the first is `{name}`: {error}"
                ));
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// Lens and pose of an image.
    pub(super) fn view(&self, image: &ColmapImage) -> Result<(&Lens, Viewmat), CamerasError> {
        let at = || format!("image {} (`{}`)", image.id, image.name);
        let lens = self.lenses.get(&image.camera_id).ok_or_else(|| {
            let known: Vec<String> = self.lenses.keys().take(8).map(u32::to_string).collect();
            let expected = format!("one of the cameras {}", known.join(", "));
            CamerasError::malformed(at(), expected, format!("camera {}", image.camera_id))
        })?;
        let pose = pose::from_quaternion(image.quat, image.translation).ok_or_else(|| {
            CamerasError::malformed(at(), "a rotation", format!("{:?}", image.quat))
        })?;
        Ok((lens, pose))
    }
}

fn parsed<T>(path: &Path, parse: impl Fn(&[u8]) -> Result<T, CamerasError>) -> Result<T, IoError> {
    parse(&read_bytes(path)?).map_err(IoError::format(path))
}

/// The model folder in a data set, or `root` itself if it is a model folder.
pub(super) fn model_folder(root: &Path) -> Option<PathBuf> {
    ["sparse/0", "sparse", "colmap/sparse/0", "dense/sparse", "."]
        .iter()
        .map(|below| root.join(below))
        .find(|folder| {
            ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file())
        })
}

/// Reads the data set of a folder: `sparse/0` with the images in `images`.
pub(super) fn open(root: &Path, reading: Reading) -> Result<CameraSet, IoError> {
    let folder = model_folder(root)
        .ok_or_else(|| IoError::content(root, "holds no COLMAP model (sparse/0/cameras.bin)"))?;
    let model = Model::read(&folder)?;
    let mut left_out = LeftOut::default();
    let mut sizes = Sizes::default();
    let count = model.total;
    let images = images_folder(root);
    let mut views = Vec::with_capacity(count);
    for (&position, image) in model.positions.iter().zip(&model.images) {
        let (lens, viewmat) = model.view(image).map_err(IoError::format(&folder))?;
        left_out.distortion(&image.name, lens);
        let (width, height) = sizes.of_first(&image_paths(&images, &image.name)).unwrap_or((0, 0));
        let mut lens = match (width, height) {
            (0, _) | (_, 0) => *lens,
            (width, height) => lens.resized(width.into(), height.into()),
        };
        if reading == Reading::Trained {
            left_out.principal_point(&image.name, &lens);
            lens = lens.centred();
        }
        let time = (reading == Reading::Trained).then(|| share(position, count));
        views.push(View {
            camera: lens.camera(viewmat, time, image.name.clone()),
            split: Split::Train,
        });
    }
    views.sort_by(|a, b| sort_key(&a.camera.name).cmp(sort_key(&b.camera.name)));
    for view in views.iter_mut().step_by(HOLD) {
        view.split = Split::Test;
    }
    let mut notes = model.notes;
    notes.extend(left_out.notes());
    notes.extend(sizes.note("COLMAP's sizes are used"));
    if reading == Reading::Trained {
        notes.push(format!(
            "times are positions in the images file divided by the number of images ({count}), as \
            in training"
        ));
    }
    Ok(CameraSet { format: Format::Colmap, path: root.to_owned(), views, video: Vec::new(), notes })
}

/// The folder of the images: `images`, or if only reduced copies exist, the largest of those.
fn images_folder(root: &Path) -> PathBuf {
    let folders = ["images", "images_2", "images_4", "images_8"].map(|name| root.join(name));
    let found = folders.iter().find(|folder| folder.is_dir());
    found.unwrap_or(&folders[0]).clone()
}

/// Possible paths of a model's image: its full name including folders, or
/// only the last part of it, as in the reference.
pub(super) fn image_paths(images: &Path, name: &str) -> [PathBuf; 2] {
    let inside = name.split(['/', '\\']).filter(|part| !["", ".", ".."].contains(part));
    [images.join(inside.collect::<PathBuf>()), images.join(basename(name))]
}

/// Sort key of the reference: the file name up to its first dot.
fn sort_key(name: &str) -> &str {
    let base = basename(name);
    base.split('.').next().unwrap_or(base)
}

/// `part / whole` as a time.
pub(super) fn share(part: usize, whole: usize) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "a time")]
    let share = (part as f64 / whole.max(1) as f64) as f32;
    share
}

impl Lens {
    /// A camera with this lens. Invalid sizes become 0, which the check
    /// of cameras reports with the camera's name.
    pub(super) fn camera(&self, viewmat: Viewmat, time: Option<f32>, name: String) -> Camera {
        Camera {
            viewmat,
            intrinsics: self.intrinsics,
            width: super::images::pixels(self.width),
            height: super::images::pixels(self.height),
            near: NEAR_PLANE,
            time,
            name,
        }
    }
}
