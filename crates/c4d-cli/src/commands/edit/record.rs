//! `NAME.edit.json` next to an edited frame: its steps, for `--replay`.

use super::resources::read_bytes;
use crate::failure::{Failure, Outcome};
use crate::output::output_failure;
use gs_io::{AtomicFile, Existing, IoError};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Kind of the file.
const KIND: &str = "steps of c4d edit";

/// Steps of an edit.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Record {
    /// [`KIND`].
    kind: String,
    /// Program and version.
    writer: String,
    /// Absolute path of the input.
    pub(super) input: PathBuf,
    /// Time of the edited frame.
    pub(super) time: f32,
    /// Number of splats of the input.
    pub(super) num_splats: usize,
    /// Number of splats of the result.
    pub(super) num_edited: usize,
    /// Folders that are searched for files named in the steps, in order.
    pub(super) folders: Vec<PathBuf>,
    /// The steps, in order.
    pub(super) steps: Vec<RecordedStep>,
}

/// One option of the command line.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct RecordedStep {
    /// Name without dashes.
    pub(super) option: String,
    /// Its argument; empty for options without one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) argument: String,
    /// Number of splats selected after it.
    pub(super) selected: usize,
}

impl Record {
    /// A record of this program.
    pub(super) fn new(input: PathBuf, time: f32, num_splats: usize, folders: Vec<PathBuf>) -> Self {
        Self {
            kind: KIND.to_owned(),
            writer: concat!("c4d ", env!("CARGO_PKG_VERSION")).to_owned(),
            input,
            time,
            num_splats,
            num_edited: num_splats,
            folders,
            steps: Vec::new(),
        }
    }

    /// Reads a record.
    pub(super) fn read(path: &Path) -> Outcome<Self> {
        let bytes = read_bytes(path)?;
        let bad = |what: String| {
            Failure::bad_input(format!("--replay {}: {what}", path.display()))
                .next("Specify the NAME.edit.json that c4d edit wrote next to NAME.ply.")
        };
        let record: Self = serde_json::from_slice(&bytes)
            .map_err(|error| bad(format!("not a record of c4d edit: {error}")))?;
        if record.kind != KIND {
            return Err(bad(format!("kind is `{}`, expected `{KIND}`", record.kind)));
        }
        Ok(record)
    }
}

/// Name of the record of `output`: `hat.edit.json` of `hat.ply`.
fn path_of(output: &Path) -> PathBuf {
    let mut name = output.file_stem().unwrap_or_default().to_owned();
    name.push(".edit.json");
    output.with_file_name(name)
}

/// A record that is created on commit.
#[derive(Debug)]
pub(super) struct RecordFile {
    file: AtomicFile,
    path: PathBuf,
}

impl RecordFile {
    /// Begins the record of `output`. An existing record is replaced together with its output, or
    /// if that no longer exists; other files never are.
    pub(super) fn create(output: &Path, existing: Existing) -> Outcome<Self> {
        let path = path_of(output);
        let theirs = path.is_file() && Record::read(&path).is_err();
        let existing = match existing {
            _ if theirs => Existing::Refuse,
            _ if !output.exists() => Existing::Replace,
            existing => existing,
        };
        let file = AtomicFile::create(&path, existing).map_err(|error| match error {
            // If both exist, the error is about the requested file.
            IoError::Exists { .. } if output.exists() && !theirs => {
                output_failure(&IoError::Exists { path: output.to_owned() })
            }
            other => output_failure(&other),
        })?;
        Ok(Self { file, path })
    }

    /// Writes the record.
    pub(super) fn write(mut self, record: &Record) -> Outcome {
        let text = serde_json::to_string_pretty(record).map_err(Failure::failed)?;
        writeln!(self.file, "{text}").map_err(|error| Failure::write(&self.path, &error))?;
        self.file.commit().map_err(|error| output_failure(&error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_next_to_their_frames() {
        assert_eq!(path_of(Path::new("a/hat.ply")), Path::new("a/hat.edit.json"), "a PLY");
        assert_eq!(path_of(Path::new("hat")), Path::new("hat.edit.json"), "no ending");
    }
}
