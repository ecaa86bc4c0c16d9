//! [`RoundTrips`]: the program, the scene, and the folder for exchanged files.

use anyhow::{Result, bail};
use gs_core::Splats;
use std::path::PathBuf;
use std::process::Command;

/// Data shared by all round trips.
pub(super) struct RoundTrips {
    /// The program `c4d`.
    pub(super) c4d: PathBuf,
    /// Folder in which programs run; the scene is `source` in it.
    pub(super) files: PathBuf,
    /// Frames of the scene.
    pub(super) frames: Vec<Splats>,
}

impl RoundTrips {
    /// Runs `c4d` in the folder.
    pub(super) fn c4d(&self, arguments: &[&str]) -> Result<()> {
        let output = Command::new(&self.c4d).args(arguments).current_dir(&self.files).output()?;
        if !output.status.success() {
            bail!("c4d {}: {}", arguments.join(" "), String::from_utf8_lossy(&output.stderr));
        }
        Ok(())
    }
}
