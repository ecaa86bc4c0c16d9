//! `NAME.manifest.json` next to an exported sequence: metadata that the format cannot store.
//!
//! It is next to the sequence, not in it, because players recognise a folder or archive as a
//! sequence only if it contains no other files.

use crate::failure::{Failure, Outcome};
use crate::output::output_failure;
use gs_io::{AtomicFile, Existing, IoError};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Contents of a manifest.
#[derive(Debug)]
pub(super) struct Content<'a> {
    /// Frames per second.
    pub(super) fps: f64,
    /// Scene times of the frames, in order.
    pub(super) times: &'a [f32],
    pub(super) num_splats: usize,
    pub(super) sh_degree: usize,
    /// The world's upward direction.
    pub(super) up: [f64; 3],
}

/// A manifest, created on commit.
#[derive(Debug)]
pub(super) struct Manifest {
    file: AtomicFile,
    path: PathBuf,
}

/// Path of the manifest of `output`: `frames.manifest.json` for `frames/`,
/// `frames.zip.manifest.json` for `frames.zip`.
fn path_of(output: &Path) -> PathBuf {
    // Removes a trailing slash.
    let output: PathBuf = output.components().collect();
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".manifest.json");
    output.with_file_name(name)
}

/// Value of the key `kind`.
const KIND: &str = "sequence of 3D Gaussian frames";

/// Whether a file is a manifest written by c4d.
fn is_ours(path: &Path) -> bool {
    let text = gs_io::read_file(path).unwrap_or_default();
    serde_json::from_slice::<serde_json::Value>(&text).is_ok_and(|found| found["kind"] == KIND)
}

/// Begins the manifest of `output`; an existing one is refused or replaced like the output itself.
/// A manifest of c4d whose output no longer exists is replaced.
pub(super) fn create(output: &Path, existing: Existing) -> Outcome<Manifest> {
    let path = path_of(output);
    // The user gave the output, not this file.
    let theirs = path.is_file() && !is_ours(&path);
    let orphan = !output.exists() && !theirs;
    let existing = match existing {
        _ if theirs => Existing::Refuse,
        _ if orphan => Existing::Replace,
        existing => existing,
    };
    let file = AtomicFile::create(&path, existing).map_err(|error| match error {
        // If both exist, report the output, which the user gave.
        IoError::Exists { .. } if output.exists() && !theirs => {
            output_failure(&IoError::Exists { path: output.to_owned() })
        }
        other => output_failure(&other),
    })?;
    Ok(Manifest { file, path })
}

impl Manifest {
    /// Writes the manifest.
    pub(super) fn write(mut self, content: &Content<'_>) -> Outcome {
        let text = json!({
            "kind": KIND,
            "writer": concat!("c4d ", env!("CARGO_PKG_VERSION")),
            "fps": content.fps,
            "num_frames": content.times.len(),
            "times": content.times,
            "num_splats": content.num_splats,
            "sh_degree": content.sh_degree,
            "up": content.up,
        });
        writeln!(self.file, "{text:#}").map_err(|error| Failure::write(&self.path, &error))?;
        self.file.commit().map_err(|error| output_failure(&error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manifest_is_next_to_the_output() {
        let named = |output: &str| path_of(Path::new(output)).display().to_string();
        assert_eq!(named("out/frames/"), "out/frames.manifest.json", "a folder");
        assert_eq!(
            named("frames.zip"),
            "frames.zip.manifest.json",
            "an archive keeps its \
                         extension"
        );
        assert_eq!(named("take.1"), "take.1.manifest.json", "a dot, but no extension");
    }
}
