//! Reading a file.

use super::entry::Entry;
use crate::cameras::{CamerasError, Unusable};
use crate::error::IoError;
use crate::fs::{read_bytes, text};
use gs_core::Camera;
use std::path::Path;

/// Parses a `cameras.json`: its valid cameras, and notes on omitted ones.
///
/// # Errors
/// If the text is not such a list, it is empty, or no camera is valid.
pub fn parse(bytes: &[u8]) -> Result<(Vec<Camera>, Vec<String>), CamerasError> {
    let entries: Vec<Entry> =
        serde_json::from_slice(&text::json(bytes)).map_err(CamerasError::json("cameras.json"))?;
    if entries.is_empty() {
        return Err(CamerasError::Empty);
    }
    let (mut cameras, mut unusable) = (Vec::with_capacity(entries.len()), Unusable::default());
    for (index, entry) in entries.into_iter().enumerate() {
        match entry.into_camera(index) {
            Ok(camera) => cameras.push(camera),
            Err(error) => unusable.add(error),
        }
    }
    let note = unusable.note(cameras.len())?;
    Ok((cameras, note.into_iter().collect()))
}

/// Reads a `cameras.json`: its valid cameras, and notes on omitted ones.
///
/// # Errors
/// If it cannot be read or [`parse`]d.
pub fn read_file(path: &Path) -> Result<(Vec<Camera>, Vec<String>), IoError> {
    parse(&read_bytes(path)?).map_err(IoError::format(path))
}
