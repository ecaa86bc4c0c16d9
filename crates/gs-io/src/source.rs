//! What the readers of trained dynamic scenes give, whatever the method: [`Source`], and what a
//! user decides: [`SourceOptions`].

use crate::repair::{Damage, RepairReport};
use gs_core::DynamicScene;
use std::path::PathBuf;

/// What a user may decide instead of the files.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SourceOptions {
    /// Which saved iteration; the newest when `None`.
    pub iteration: Option<u64>,
    /// What to do with damaged rows.
    pub damage: Damage,
    /// Start and end of the scene in the unit of its Gaussians' times, for native 4D Gaussians,
    /// whose files do not say it.
    pub time_duration: Option<[f64; 2]>,
    /// Half the side of the cube that the grids of Grid4D and DASH cover, if `cfg_args` does not
    /// say it.
    pub bound: Option<f32>,
}

/// A trained dynamic scene, read.
#[derive(Debug)]
pub struct Source {
    /// The scene, times 0 to 1.
    pub scene: Box<dyn DynamicScene>,
    /// What was found, name and value, to be shown.
    pub facts: Vec<(&'static str, String)>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// What was read otherwise than stored, or not understood and not needed.
    pub notes: Vec<String>,
    /// Damaged rows.
    pub repair: RepairReport,
    /// The files read, whose content decides what the scene is.
    pub files: Vec<PathBuf>,
    /// Background that the model was trained with, if its files say so.
    pub background: Option<[f32; 3]>,
    /// The world's upward direction, where the method's data sets have one of their own.
    pub up: Option<[f64; 3]>,
}

impl Source {
    /// A scene from these files of which nothing else is known.
    pub(crate) fn new(scene: impl DynamicScene + 'static, files: Vec<PathBuf>) -> Self {
        Self {
            scene: Box::new(scene),
            facts: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            repair: RepairReport::default(),
            files,
            background: None,
            up: None,
        }
    }
}
