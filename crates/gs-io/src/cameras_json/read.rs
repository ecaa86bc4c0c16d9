//! Reading a file.

use super::entry::Entry;
use crate::cameras::CamerasError;
use crate::error::IoError;
use crate::fs::{read_bytes, text};
use gs_core::Camera;
use std::path::Path;

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
