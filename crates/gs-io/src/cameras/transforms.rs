//! `transforms_*.json` of D-NeRF and Blender, and `transforms.json` of nerfstudio: camera-to-world
//! matrices with OpenGL's axes.
//!
//! Trained reading: 800×800 images, one field of view per file, times divided by the largest of
//! train and test, and a translation whose x has the wrong sign (without effect for cameras that
//! look at the origin, as all D-NeRF cameras do). Stored reading: individual intrinsics and sizes,
//! times divided by the same maximum.

use super::colmap::share;
use super::images::{Sizes, is_image, pixels};
use super::lens::{LeftOut, Lens};
use super::set::check_all;
use super::{CameraSet, CamerasError, Format, Number, Reading, Split, Unusable, View, paths, pose};
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::fs::text;
use gs_core::image_formation::NEAR_PLANE;
use gs_core::{Camera, Intrinsics};
use serde::Deserialize;
use std::path::Path;

/// Image side of the reference's D-NeRF reader, pixels.
const TRAINED_SIDE: f64 = 800.0;
/// Files of a data set in the order of its splits.
const FILES: [(&str, Split); 4] = [
    ("transforms_train.json", Split::Train),
    ("transforms_test.json", Split::Test),
    ("transforms_val.json", Split::Val),
    ("transforms.json", Split::None),
];

/// Intrinsics, of a file or of one of its frames. Pixels; angles in radians.
#[derive(Debug, Clone, Default, Deserialize)]
struct Optics {
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    camera_model: Option<String>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct TransformsFrame {
    file_path: String,
    time: Option<f64>,
    transform_matrix: Vec<Vec<Number>>,
    #[serde(flatten)]
    optics: Optics,
}

/// A `transforms` file.
#[derive(Debug, Deserialize)]
pub struct Transforms {
    #[serde(flatten)]
    optics: Optics,
    frames: Vec<TransformsFrame>,
}

/// Parses a `transforms` file. Poses are checked when cameras are built from them.
///
/// # Errors
/// If it is not JSON of this form.
pub fn parse(bytes: &[u8]) -> Result<Transforms, CamerasError> {
    serde_json::from_slice(&text::json(bytes)).map_err(CamerasError::json("transforms file"))
}

impl Transforms {
    /// Cameras of the file at their times divided by `max_time`, without reading images.
    ///
    /// # Errors
    /// If a camera is invalid, a matrix is not 4×4 (or its first three rows), or a frame has no
    /// focal length.
    pub fn cameras(&self, reading: Reading, max_time: f64) -> Result<Vec<Camera>, CamerasError> {
        let mut context = Context::new(reading, max_time);
        let cameras: Vec<Camera> = (0..self.frames.len())
            .map(|index| context.camera(self, index, None))
            .collect::<Result<_, _>>()?;
        check_all(cameras.iter())?;
        Ok(cameras)
    }

    /// Largest time of the file; 0 if it has none.
    pub fn max_time(&self) -> f64 {
        self.frames.iter().filter_map(|frame| frame.time).fold(0.0, f64::max)
    }

    /// The field of view of the whole file, horizontal, radians.
    fn fov_x_rad(&self) -> Option<f64> {
        let optics = &self.optics;
        let from_focal = || Some(2.0 * (optics.w? / (2.0 * optics.fl_x?)).atan());
        optics.camera_angle_x.or_else(from_focal)
    }
}

/// Settings for building cameras, and notes collected on the way.
struct Context {
    reading: Reading,
    max_time: f64,
    left_out: LeftOut,
    sizes: Sizes,
    assumed_size: usize,
    /// Largest displacement by the reference's sign error, world units.
    slip: f64,
}

impl Context {
    fn new(reading: Reading, max_time: f64) -> Self {
        Self {
            reading,
            max_time,
            left_out: LeftOut::default(),
            sizes: Sizes::default(),
            assumed_size: 0,
            slip: 0.0,
        }
    }

    /// The camera of a frame; `root` is the folder to which image paths are relative.
    fn camera(
        &mut self,
        file: &Transforms,
        index: usize,
        root: Option<&Path>,
    ) -> Result<Camera, CamerasError> {
        let frame = &file.frames[index];
        let at = || format!("frame {index} (`{}`)", frame.file_path);
        let rows = &frame.transform_matrix;
        if !(3..=4).contains(&rows.len()) || rows.iter().any(|row| row.len() != 4) {
            return Err(CamerasError::malformed(
                at(),
                "a transform_matrix of 4×4 numbers",
                format!("{} rows of {:?}", rows.len(), rows.first().map_or(0, Vec::len)),
            ));
        }
        let mut matrix = [[0.0; 4]; 3];
        for (row, values) in matrix.iter_mut().zip(rows) {
            *row = std::array::from_fn(|k| values[k].0);
        }
        let mut viewmat = pose::from_opengl(&matrix);
        let lens = match (self.reading, file.fov_x_rad()) {
            (Reading::Trained, Some(fov)) => {
                // The reference negates all three components, although the
                // change of axes negates only y and z.
                viewmat[0][3] = -viewmat[0][3];
                self.slip = self.slip.max(2.0 * viewmat[0][3].abs());
                let focal = TRAINED_SIDE / (2.0 * (fov / 2.0).tan());
                let (cx, cy) = (TRAINED_SIDE / 2.0, TRAINED_SIDE / 2.0);
                let intrinsics = Intrinsics { fx: focal, fy: focal, cx, cy };
                Lens::pinhole(intrinsics, TRAINED_SIDE, TRAINED_SIDE)
            }
            _ => self.stored_lens(file, frame, root).map_err(|missing| match missing {
                Missing::Focal => {
                    CamerasError::malformed(at(), "camera_angle_x or fl_x", "neither")
                }
                Missing::Pinhole(model) => CamerasError::Lens { camera: at(), model },
            })?,
        };
        let time = frame.time.map(|time| {
            #[expect(clippy::cast_possible_truncation, reason = "a time")]
            let share = (time / if self.max_time > 0.0 { self.max_time } else { 1.0 }) as f32;
            share
        });
        let name = frame.file_path.trim_start_matches("./").to_owned();
        self.left_out.distortion(&name, &lens);
        Ok(lens.camera(viewmat, time, name))
    }

    fn stored_lens(
        &mut self,
        file: &Transforms,
        frame: &TransformsFrame,
        root: Option<&Path>,
    ) -> Result<Lens, Missing> {
        let (own, shared) = (&frame.optics, &file.optics);
        let value = |pick: fn(&Optics) -> Option<f64>| pick(own).or_else(|| pick(shared));
        if let Some(model) = own.camera_model.as_ref().or(shared.camera_model.as_ref())
            && !["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"]
                .contains(&model.as_str())
        {
            return Err(Missing::Pinhole(model.clone()));
        }
        let image = || {
            let mut path = root?.join(frame.file_path.trim_start_matches("./"));
            if !is_image(&frame.file_path) {
                path.as_mut_os_string().push(".png");
            }
            self.sizes.of(&path).map(|(width, height)| (f64::from(width), f64::from(height)))
        };
        let declared = value(|o| o.w).zip(value(|o| o.h));
        let (width, height) = declared.or_else(image).unwrap_or_else(|| {
            self.assumed_size += 1;
            (TRAINED_SIDE, TRAINED_SIDE)
        });
        let from_angle = |side: f64| move |angle: f64| side / (2.0 * (angle / 2.0).tan());
        let fx = value(|o| o.fl_x)
            .or_else(|| value(|o| o.camera_angle_x).map(from_angle(width)))
            .ok_or(Missing::Focal)?;
        let fy = value(|o| o.fl_y)
            .or_else(|| value(|o| o.camera_angle_y).map(from_angle(height)))
            .unwrap_or(fx);
        let cx = value(|o| o.cx).unwrap_or(width / 2.0);
        let cy = value(|o| o.cy).unwrap_or(height / 2.0);
        let number = |pick| value(pick).unwrap_or(0.0);
        Ok(Lens {
            radial: [number(|o| o.k1), number(|o| o.k2), number(|o| o.k3)],
            tangential: [number(|o| o.p1), number(|o| o.p2)],
            ..Lens::pinhole(Intrinsics { fx, fy, cx, cy }, width, height)
        })
    }

    fn notes(self) -> Vec<String> {
        let mut notes = self.left_out.notes();
        if self.assumed_size > 0 {
            notes.push(format!(
                "{} views have neither a size in the files nor an image: D-NeRF's 800×800 is \
                assumed",
                self.assumed_size
            ));
        }
        if self.reading == Reading::Trained {
            notes.push("images are 800×800, as in training".to_owned());
        }
        if self.slip > 1e-4 {
            notes.push(format!(
                "4DGaussians reads these cameras' translations with the wrong sign of x (up to \
                {:.3} world units here) and trains with them, so this reader does the same",
                self.slip
            ));
        }
        notes
    }
}

/// Missing data for a stored lens.
enum Missing {
    Focal,
    Pinhole(String),
}

/// Reads the files of a folder, or one of them.
pub(super) fn open(
    root: &Path,
    only: Option<&str>,
    reading: Reading,
) -> Result<CameraSet, IoError> {
    let read = |name: &str| -> Result<Option<Transforms>, IoError> {
        let path = root.join(name);
        if !path.is_file() {
            return Ok(None);
        }
        parse(&read_bytes(&path)?).map(Some).map_err(IoError::format(&path))
    };
    let train = read(FILES[0].0)?;
    let test = read(FILES[1].0)?;
    let trained_times = [&train, &test].into_iter().flatten().map(Transforms::max_time);
    let mut max_time = trained_times.fold(0.0, f64::max);
    let mut files = Vec::new();
    if let Some(name) = only {
        let known = FILES.iter().find(|(known, _)| *known == name);
        let split = known.map_or(Split::None, |(_, split)| *split);
        files.extend(read(name)?.map(|file| (name.to_owned(), file, split)));
    } else {
        let mut rest = [train, test].into_iter();
        for (name, split) in FILES {
            let file = match rest.next() {
                Some(file) => file,
                // If there are files per split, a file with all views would count them twice.
                None if split == Split::None && !files.is_empty() => None,
                None => read(name)?,
            };
            files.extend(file.map(|file| (name.to_owned(), file, split)));
        }
    }
    if max_time <= 0.0 {
        max_time = files.iter().map(|(_, file, _)| file.max_time()).fold(0.0, f64::max);
    }
    let mut context = Context::new(reading, max_time);
    let (mut views, mut unusable, mut notes) = (Vec::new(), Unusable::default(), Vec::new());
    for (_, file, split) in &files {
        // The reference trains only on D-NeRF's own files.
        context.reading = if *split == Split::None { Reading::Stored } else { reading };
        for index in 0..file.frames.len() {
            match context.camera(file, index, Some(root)) {
                Ok(camera) => views.push(View { camera, split: *split }),
                // An unusable lens or pose affects only its own views.
                Err(error) => unusable.add(error),
            }
        }
    }
    let first_file = files.first().map_or(FILES[0].0, |(name, ..)| name.as_str());
    notes.extend(unusable.note(views.len()).map_err(IoError::format(&root.join(first_file)))?);
    let video = match files.iter().find(|(.., split)| *split == Split::Train) {
        Some((_, file, _)) => file.fov_x_rad().map(circle).unwrap_or_default(),
        None => Vec::new(),
    };
    notes.extend(context.notes());
    if max_time > 0.0 && (max_time - 1.0).abs() > 1e-9 {
        notes.push(format!("times are divided by the largest time of train and test, {max_time}"));
    }
    Ok(CameraSet { format: Format::Transforms, path: root.to_owned(), views, video, notes })
}

/// The reference's 160 views on a circle around the origin, at 30° of elevation and radius 4.
fn circle(fov_x_rad: f64) -> Vec<Camera> {
    const FRAMES: usize = 160;
    let focal = TRAINED_SIDE / (2.0 * (fov_x_rad / 2.0).tan());
    (0..FRAMES)
        .map(|frame| {
            let azimuth_rad = (frame as f64 / FRAMES as f64)
                .mul_add(std::f64::consts::TAU, -std::f64::consts::PI);
            let viewmat =
                pose::from_opengl(&paths::on_sphere(azimuth_rad, -30.0_f64.to_radians(), 4.0));
            Camera {
                viewmat,
                intrinsics: Intrinsics {
                    fx: focal,
                    fy: focal,
                    cx: TRAINED_SIDE / 2.0,
                    cy: TRAINED_SIDE / 2.0,
                },
                width: pixels(TRAINED_SIDE),
                height: pixels(TRAINED_SIDE),
                near: NEAR_PLANE,
                time: Some(share(frame, FRAMES - 1)),
                name: format!("video/{frame:04}"),
            }
        })
        .collect()
}
