//! [`PartFolder`]: the files of a part, and their checksums.

use super::record::{PartRecord, broken};
use crate::failure::{Failure, Outcome};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the record in the folder.
const PART: &str = "part.json";
/// Maximum depth of files in a part: view and pass.
const MAX_DEPTH: usize = 3;

/// The record of a folder that contains a part.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct PartFolder {
    #[serde(flatten)]
    pub(crate) record: PartRecord,
    /// CRC-32 of each file, by its path relative to the folder, with `/`.
    pub(crate) files: BTreeMap<String, u32>,
}

impl PartFolder {
    /// Whether `path` is a folder with a record.
    pub(crate) fn is_at(path: &Path) -> bool {
        path.join(PART).is_file()
    }

    /// Writes the record into `folder`, whose files are complete.
    pub(crate) fn write(record: PartRecord, folder: &Path) -> Outcome {
        let mut files = BTreeMap::new();
        list(folder, "", 0, &mut files)?;
        let path = folder.join(PART);
        let text =
            serde_json::to_string_pretty(&Self { record, files }).map_err(Failure::failed)?;
        std::fs::write(&path, text).map_err(|error| Failure::write(&path, &error))
    }

    /// Reads the record of `folder` and verifies its files.
    pub(crate) fn read(folder: &Path) -> Outcome<Self> {
        let path = folder.join(PART);
        let bytes = gs_io::read_file(&path).map_err(|error| broken(&path, &error.to_string()))?;
        let part: Self =
            serde_json::from_slice(&bytes).map_err(|error| broken(&path, &error.to_string()))?;
        let mut found = BTreeMap::new();
        list(folder, "", 0, &mut found)?;
        let differs = |name: &&String| part.files.get(*name) != found.get(*name);
        if let Some(name) = part.files.keys().chain(found.keys()).find(differs) {
            let what = match (part.files.contains_key(name), found.contains_key(name)) {
                (true, false) => "is missing",
                (false, _) => "is not one of the part's files",
                _ => "was changed after it was written",
            };
            return Err(broken(folder, &format!("{name} {what}")));
        }
        Ok(part)
    }
}

/// The files below `folder` with their checksums, except records.
fn list(folder: &Path, prefix: &str, depth: usize, files: &mut BTreeMap<String, u32>) -> Outcome {
    let refused = |path: &Path, error: std::io::Error| {
        Failure::bad_input(format!("cannot read {}: {error}", path.display()))
    };
    for entry in std::fs::read_dir(folder).map_err(|error| refused(folder, error))? {
        let entry = entry.map_err(|error| refused(folder, error))?;
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') || (depth == 0 && name == PART) {
            continue;
        }
        if entry.file_type().map_err(|error| refused(&path, error))?.is_dir() {
            if depth < MAX_DEPTH {
                list(&path, &format!("{prefix}{name}/"), depth + 1, files)?;
            }
            continue;
        }
        let bytes = gs_io::read_file(&path).map_err(|error| refused(&path, error))?;
        files.insert(format!("{prefix}{name}"), crc32fast::hash(&bytes));
    }
    Ok(())
}
