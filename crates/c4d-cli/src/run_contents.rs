//! [`RunContents`]: the arrays of a run folder.

use crate::failure::{Failure, Outcome, chain};
use crate::run_folder::{RunFiles, SCENE, damaged};
use amg::Binding;
use gs_core::Splats;
use std::path::{Path, PathBuf};

/// The arrays of a run folder, without its source.
#[derive(Debug, Clone, PartialEq)]
pub struct RunContents {
    /// The edited frame; with refined colours and opacities if the run is refined.
    pub edited: Splats,
    /// Source splats and weights of every edited splat.
    pub binding: Binding,
    /// Path of the source scene.
    pub source: PathBuf,
    /// Time of the edited frame.
    pub edit_time: f32,
    /// Whether the run is refined.
    pub is_refined: bool,
}

impl RunContents {
    /// Reads a run folder.
    ///
    /// # Errors
    /// If `path` is not a run folder, or its files are damaged.
    pub fn read(path: &Path) -> Outcome<Self> {
        let RunFiles { config, stored, source } = RunFiles::read(path)?;
        let is_refined = stored.refined.is_some();
        let (edited, binding) = match &stored.refined {
            Some(rows) => {
                let binding = rows
                    .rebind(&stored.edited, &stored.binding)
                    .map_err(|error| -> Failure { damaged(path, SCENE, &chain(&error)) })?;
                (rows.apply(&stored.edited), binding)
            }
            None => (stored.edited, stored.binding),
        };
        Ok(Self { edited, binding, source, edit_time: config.edit_time, is_refined })
    }
}
