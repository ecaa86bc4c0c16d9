//! `cameras.json` as the 3DGS reference writes it: camera-to-world poses, focal lengths in pixels.
//!
//! Keys beyond that schema: `cx`, `cy` (principal point in pixels, the image centre when absent) and `time` (scene time;
//! when absent the camera looks at every time). Unknown keys are ignored.

use crate::atomic::{AtomicFile, Existing};
use crate::cameras::{CamerasError, pixels};
use crate::error::IoError;
use crate::input::read_bytes;
use crate::text;
use gs_core::image_formation::NEAR_PLANE;
use gs_core::{Camera, Intrinsics};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    id: Option<serde_json::Value>,
    #[serde(default)]
    img_name: String,
    #[serde(serialize_with = "whole")]
    width: f64,
    #[serde(serialize_with = "whole")]
    height: f64,
    position: [f64; 3],
    rotation: [[f64; 3]; 3],
    fx: f64,
    fy: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cx: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cy: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time: Option<f32>,
}

/// Writes a size as an integer: strict readers refuse `960.0`.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn whole<S: serde::Serializer>(size: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "written from a u32"
    )]
    serializer.serialize_u32(*size as u32)
}

impl Entry {
    fn into_camera(self, index: usize) -> Result<Camera, CamerasError> {
        let name = if self.img_name.is_empty() { format!("{index}") } else { self.img_name };
        let (r, p) = (self.rotation, self.position);
        // The inverse of a camera-to-world pose: rows of the result are columns of `rotation`.
        let row = |k: usize| {
            let axis = [r[0][k], r[1][k], r[2][k]];
            let shift = -(axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2]);
            [axis[0], axis[1], axis[2], shift]
        };
        let camera = Camera {
            viewmat: [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
            intrinsics: Intrinsics {
                fx: self.fx,
                fy: self.fy,
                cx: self.cx.unwrap_or(self.width / 2.0),
                cy: self.cy.unwrap_or(self.height / 2.0),
            },
            // Sizes that are no pixel counts become 0, which the check below refuses by name.
            width: pixels(self.width),
            height: pixels(self.height),
            near: NEAR_PLANE,
            time: self.time,
            name,
        };
        camera.check().map_err(|source| CamerasError::Camera { index, source })?;
        Ok(camera)
    }

    fn from_camera(index: usize, camera: &Camera) -> Self {
        let v = &camera.viewmat;
        Self {
            id: Some(index.into()),
            img_name: camera.name.clone(),
            width: camera.width.into(),
            height: camera.height.into(),
            position: camera.position(),
            rotation: std::array::from_fn(|i| std::array::from_fn(|k| v[k][i])),
            fx: camera.intrinsics.fx,
            fy: camera.intrinsics.fy,
            cx: Some(camera.intrinsics.cx),
            cy: Some(camera.intrinsics.cy),
            time: camera.time,
        }
    }
}

/// Parses a `cameras.json`.
///
/// # Errors
/// If the text is not such a list, it is empty, or a camera is out of range.
pub fn parse(bytes: &[u8]) -> Result<Vec<Camera>, CamerasError> {
    let entries: Vec<Entry> =
        serde_json::from_slice(&text::utf8(bytes)).map_err(CamerasError::json("cameras.json"))?;
    if entries.is_empty() {
        return Err(CamerasError::Empty);
    }
    entries.into_iter().enumerate().map(|(index, entry)| entry.into_camera(index)).collect()
}

/// Reads a `cameras.json`.
///
/// # Errors
/// If it cannot be read or [`parse`]d.
pub fn read_file(path: impl AsRef<Path>) -> Result<Vec<Camera>, IoError> {
    let path = path.as_ref();
    parse(&read_bytes(path)?).map_err(|source| IoError::Cameras { path: path.to_owned(), source })
}

/// The text of a `cameras.json`, principal points and times included.
///
/// # Errors
/// If a camera is out of range.
pub fn to_json(cameras: &[Camera]) -> Result<String, CamerasError> {
    for (index, camera) in cameras.iter().enumerate() {
        camera.check().map_err(|source| CamerasError::Camera { index, source })?;
    }
    let entries: Vec<Entry> = cameras
        .iter()
        .enumerate()
        .map(|(index, camera)| Entry::from_camera(index, camera))
        .collect();
    serde_json::to_string_pretty(&entries).map_err(CamerasError::json("cameras.json"))
}

/// Writes a `cameras.json`.
///
/// # Errors
/// If a camera is out of range, or the file exists and may not be replaced, or cannot be written.
pub fn write_file(
    path: impl AsRef<Path>,
    cameras: &[Camera],
    existing: Existing,
) -> Result<(), IoError> {
    let path = path.as_ref();
    let text =
        to_json(cameras).map_err(|source| IoError::Cameras { path: path.to_owned(), source })?;
    let mut file = AtomicFile::create(path, existing)?;
    file.write_all(text.as_bytes()).map_err(IoError::write(path))?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip() {
        let mut camera =
            Camera::look_at([3.0, 1.0, -2.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0], 0.7, 640, 480);
        camera.name = "cam00/0007".to_owned();
        camera.time = Some(0.25);
        camera.intrinsics.cx = 300.5;
        let back = parse(to_json(std::slice::from_ref(&camera)).unwrap().as_bytes()).unwrap();
        assert_eq!(back.len(), 1, "one");
        assert_eq!((&back[0].name, back[0].time), (&camera.name, Some(0.25)), "name and time");
        assert_eq!(back[0].intrinsics, camera.intrinsics, "intrinsics");
        for (row, (ours, theirs)) in back[0].viewmat.iter().zip(camera.viewmat).enumerate() {
            for (a, b) in ours.iter().zip(theirs) {
                assert!((a - b).abs() < 1e-12, "row {row}: {a} {b}");
            }
        }
    }

    #[test]
    fn reads_the_reference_schema() {
        let text = r#"[{"id": 0, "img_name": "r_0", "width": 800, "height": 600, "position": [1, 2, 3],
            "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fy": 1100.0, "fx": 1111.0}]"#;
        let cameras = parse(text.as_bytes()).unwrap();
        assert_eq!(cameras[0].intrinsics.cy, 300.0, "centred");
        assert_eq!(cameras[0].position(), [1.0, 2.0, 3.0], "centre");
        assert_eq!(cameras[0].time, None, "every time");
    }

    #[test]
    fn bad_files_are_refused() {
        let camera = |width: &str, rotation: &str| {
            format!(
                r#"[{{"width": {width}, "height": 6, "position": [1, 2, 3], "rotation": {rotation}, "fy": 1.0, "fx": 1.0}}]"#
            )
        };
        let good = "[[1,0,0],[0,1,0],[0,0,1]]";
        assert!(parse(camera("8", good).as_bytes()).is_ok(), "no name and id");
        for text in [
            "",
            "{}",
            "[]",
            "[{}]",
            "null",
            &camera("0", good),
            &camera("1e99", good),
            &camera("-5", good),
            &camera("8", "[[2,0,0],[0,1,0],[0,0,1]]"),
            &camera("8", "[[1,0],[0,1]]"),
        ] {
            assert!(parse(text.as_bytes()).is_err(), "{text}");
        }
    }
}
