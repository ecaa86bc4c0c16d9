//! [`LoadedScene`]: a scene with the metadata of its files.

use crate::passes::Mask;
use amg::Binding;
use gs_core::DynamicScene;
use gs_io::{DeformedModel, SceneKind};
use std::path::PathBuf;
use std::sync::Arc;

/// Captured scenes: y points down.
pub(crate) const UP_CAPTURED: [f64; 3] = [0.0, -1.0, 0.0];

/// An opened scene.
#[derive(Debug)]
pub(crate) struct LoadedScene {
    /// The scene itself.
    pub(crate) scene: Arc<dyn DynamicScene>,
    /// The scene's own deformation network with its canonical splats, if it has one.
    pub(crate) network: Option<DeformedModel>,
    /// Kind of the path.
    pub(crate) kind: SceneKind,
    /// Path as given.
    pub(crate) path: PathBuf,
    /// The scene before the edit, for runs.
    pub(crate) original: Option<Arc<dyn DynamicScene>>,
    /// For each splat of a run, the source splat with the same geometry, moved or not.
    pub(crate) source_rows: Option<Vec<Option<u32>>>,
    /// Binding of a run's splats to its source, as stored by `c4d propagate`.
    pub(crate) binding: Option<Arc<Binding>>,
    /// Time of the edited frame: a run's, else the start.
    pub(crate) edit_time: f32,
    /// The world's upward direction, according to the files.
    pub(crate) up: [f64; 3],
    /// Frames per second of the clip, if its files store them.
    pub(crate) fps: Option<f64>,
    /// Background used in the model's training, else black.
    pub(crate) background: [f32; 3],
    /// Parameters of the artifact mask: those of the run's refinement, else the defaults.
    pub(crate) mask: Mask,
    /// Properties for display: name and value.
    pub(crate) facts: Vec<(&'static str, String)>,
    /// Folders from which the scene is read, including sources of runs.
    pub(crate) roots: Vec<PathBuf>,
    /// Files whose content determines the scene, for fingerprints.
    pub(crate) files: Vec<PathBuf>,
}
