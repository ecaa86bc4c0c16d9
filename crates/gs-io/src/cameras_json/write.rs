//! Writing a file.

use super::entry::Entry;
use crate::cameras::CamerasError;
use crate::error::IoError;
use crate::fs::{AtomicFile, Existing};
use gs_core::Camera;
use std::io::Write;
use std::path::Path;

/// The text of a `cameras.json`, including principal points and times.
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
pub fn write_file(path: &Path, cameras: &[Camera], existing: Existing) -> Result<(), IoError> {
    let text = to_json(cameras).map_err(IoError::format(path))?;
    let mut file = AtomicFile::create(path, existing)?;
    file.write_all(text.as_bytes()).map_err(IoError::write(path))?;
    file.commit()
}
