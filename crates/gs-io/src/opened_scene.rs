//! [`OpenedScene`]: a scene with the information in its files.

use crate::deformed_model::DeformedModel;
use crate::model_folder::ModelReport;
use crate::repair::RepairReport;
use crate::scene_kind::SceneKind;
use gs_core::DynamicScene;
use std::path::PathBuf;
use std::sync::Arc;

/// An opened scene of any kind.
#[derive(Debug)]
#[non_exhaustive]
pub struct OpenedScene {
    /// The scene.
    pub scene: Arc<dyn DynamicScene>,
    /// Kind of the path from which it was read.
    pub kind: SceneKind,
    /// The scene as a deformed model, if its deformation network can be evaluated at other
    /// positions.
    pub deformed: Option<DeformedModel>,
    /// Contents and resolved settings of model folders of 4DGaussians and Swift4D.
    pub report: Option<ModelReport>,
    /// Properties to display, as names and values.
    pub facts: Vec<(&'static str, String)>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Values that were read differently from how they are stored, or that are unknown and not
    /// needed.
    pub notes: Vec<String>,
    /// Details that few users need: ignored entries of a folder, hints.
    pub details: Vec<String>,
    /// Counts of damaged rows; `warnings` and `notes` describe them.
    pub repair: RepairReport,
    /// The files read, whose content determines the scene.
    pub files: Vec<PathBuf>,
    /// Background used in training, RGB from 0 to 1 as in `gs_core::RenderParams`, if the files
    /// state it.
    pub background: Option<[f32; 3]>,
    /// The world's upward direction, if the files state it or all data sets of the method share
    /// one.
    pub up: Option<[f64; 3]>,
    /// Frames per second of the clip, if the files state it.
    pub fps: Option<f64>,
}

impl OpenedScene {
    /// A scene from these files, without further information.
    pub(crate) fn new(
        kind: SceneKind,
        scene: impl DynamicScene + 'static,
        files: Vec<PathBuf>,
    ) -> Self {
        Self::shared(kind, Arc::new(scene), files)
    }

    /// As [`OpenedScene::new`], for a scene that is already shared.
    pub(crate) fn shared(
        kind: SceneKind,
        scene: Arc<dyn DynamicScene>,
        files: Vec<PathBuf>,
    ) -> Self {
        Self {
            scene,
            kind,
            deformed: None,
            report: None,
            facts: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            details: Vec::new(),
            repair: RepairReport::default(),
            files,
            background: None,
            up: None,
            fps: None,
        }
    }
}
