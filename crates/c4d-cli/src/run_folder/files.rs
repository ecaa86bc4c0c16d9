//! Names of the files of a run folder.

/// Edited scene, safetensors.
pub(crate) const SCENE: &str = "scene.c4d";
/// Resolved configuration.
pub(crate) const CONFIG: &str = "c4d.toml";
/// Report of the run.
pub(crate) const REPORT: &str = "run.json";
/// Report of the refinement.
pub(crate) const REFINE_REPORT: &str = "refine.json";
/// Checkpoint of an unfinished refinement.
pub(crate) const REFINE_STATE: &str = "refine.state";
/// Images of an unfinished refinement.
pub(crate) const REFINE_IMAGES: &str = "refine.images";
/// Previews of a refinement.
pub(crate) const PREVIEWS: &str = "previews";
/// Small report with pictures.
pub(crate) const REPORT_PAGE: &str = "report.html";
