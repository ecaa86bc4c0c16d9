//! Reading either file.

use super::{checkpoint, ply_file};
use crate::error::IoError;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use std::path::Path;

/// Whether a PLY with these columns besides those of 3DGS is from FreeTimeGS.
pub(crate) fn has_columns(extra_columns: &[String]) -> bool {
    let has = |name: &str| extra_columns.iter().any(|column| column == name);
    has("time") && has("log_duration")
}

/// Opens a `.ftgs.ply` or a checkpoint.
///
/// # Errors
/// If the file cannot be read, lacks parts, or was trained with an option that is not supported.
pub fn open(path: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let bytes = crate::fs::read_bytes(path)?;
    let model = if bytes.starts_with(b"PK") {
        checkpoint::read(&bytes, path)?
    } else {
        ply_file::read(&bytes, path)?
    };
    model.into_source(path, options)
}
