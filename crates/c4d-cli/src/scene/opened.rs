//! [`Opened`]: a scene with what its files say about it.

use crate::passes::Mask;
use gs_core::DynamicScene;
use gs_io::{DeformedModel, SceneKind};
use std::path::PathBuf;
use std::sync::Arc;

/// Captured scenes: y points down.
pub(crate) const UP_CAPTURED: [f64; 3] = [0.0, -1.0, 0.0];

/// A scene ready to be asked for any time.
#[derive(Debug)]
pub(crate) struct Opened {
    /// The scene itself.
    pub(crate) scene: Arc<dyn DynamicScene>,
    /// The scene's own deformation network with its canonical splats, where it has one.
    pub(crate) network: Option<DeformedModel>,
    /// What the path is.
    pub(crate) kind: SceneKind,
    /// As given.
    pub(crate) path: PathBuf,
    /// The scene before the edit, for runs.
    pub(crate) original: Option<Arc<dyn DynamicScene>>,
    /// For each splat of a run, the source splat whose geometry it has, moved or not.
    pub(crate) source_rows: Option<Vec<Option<u32>>>,
    /// Time of the edited frame: a run's, else the start.
    pub(crate) edit_time: f32,
    /// The world's upward direction, as far as the files tell.
    pub(crate) up: [f64; 3],
    /// Frames per second of the clip, where its files note them.
    pub(crate) fps: Option<f64>,
    /// Background the model was trained with, else black.
    pub(crate) background: [f32; 3],
    /// Which pixels are artifacts: as a run was refined, else as usual.
    pub(crate) mask: Mask,
    /// Facts to show, name and value.
    pub(crate) facts: Vec<(&'static str, String)>,
    /// Folders the scene is read from, sources of runs included.
    pub(crate) roots: Vec<PathBuf>,
    /// Files whose content decides what the scene is, for fingerprints.
    pub(crate) files: Vec<PathBuf>,
}
