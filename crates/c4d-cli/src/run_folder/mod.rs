//! The run folder: the small output of `c4d propagate`, sufficient to reopen the edited scene.
//!
//! | file | content |
//! |---|---|
//! | `scene.c4d` | safetensors: edited splats, sparse binding to the source, refined colours |
//! | `c4d.toml` | resolved configuration: inputs with fingerprints, options, seed, version |
//! | `run.json` | report: counts, convergence, timings, warnings |
//! | `report.html` | one page that opens offline: pictures before and after, warnings, steps |
//! | `refine.json` | report of the refinement |
//! | `refine.state`, `refine.images` | its checkpoint and its images while it is unfinished |
//!
//! The source scene is referenced, not copied; its fingerprint is checked when the run is opened.

mod checkpoint;
mod config;
mod entry;
mod files;
mod fingerprint;
mod kept_images;
mod read;
mod scene_file;
mod source_path;
mod surface_entries;

pub(crate) use checkpoint::Checkpoint;
pub(crate) use config::{RefineConfig, RunConfig};
pub(crate) use files::{
    CONFIG, PREVIEWS, REFINE_IMAGES, REFINE_REPORT, REFINE_STATE, REPORT, REPORT_PAGE, SCENE,
};
pub(crate) use fingerprint::fingerprint;
pub(crate) use kept_images::{KeptImages, MadeFrom};
pub(crate) use read::{RunFiles, check_is_folder, damaged, reports};
pub(crate) use scene_file::{RefinedRows, Stored};
pub(crate) use source_path::relative;
