//! [`OpenedScene`]: a scene with what its files say about it.

use crate::deformed_model::DeformedModel;
use crate::model_folder::ModelReport;
use crate::repair::RepairReport;
use crate::scene_kind::SceneKind;
use gs_core::DynamicScene;
use std::path::PathBuf;
use std::sync::Arc;

/// A scene of any kind, read.
#[derive(Debug)]
#[non_exhaustive]
pub struct OpenedScene {
    /// The scene.
    pub scene: Arc<dyn DynamicScene>,
    /// What it was read from.
    pub kind: SceneKind,
    /// The scene again, if it has a deformation network that can be evaluated at other positions.
    pub deformed: Option<DeformedModel>,
    /// What was found and decided, for model folders of 4DGaussians and Swift4D.
    pub report: Option<ModelReport>,
    /// What was found, name and value, to be shown.
    pub facts: Vec<(&'static str, String)>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// What was read otherwise than stored, or not understood and not needed.
    pub notes: Vec<String>,
    /// What only a user looking for it needs: entries of a folder that were ignored, hints.
    pub details: Vec<String>,
    /// Damaged rows, counted; `warnings` and `notes` say it in words.
    pub repair: RepairReport,
    /// The files read, whose content decides what the scene is.
    pub files: Vec<PathBuf>,
    /// Background that the model was trained with, linear RGB, if its files say so.
    pub background: Option<[f32; 3]>,
    /// The world's upward direction, if the files say so or the method's data sets have one of
    /// their own.
    pub up: Option<[f64; 3]>,
    /// Frames per second of the clip, if the files say so.
    pub fps: Option<f64>,
}

impl OpenedScene {
    /// A scene from these files of which nothing else is known.
    pub(crate) fn new(
        kind: SceneKind,
        scene: impl DynamicScene + 'static,
        files: Vec<PathBuf>,
    ) -> Self {
        Self::shared(kind, Arc::new(scene), files)
    }

    /// As [`OpenedScene::new`], for a scene that is shared already.
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
