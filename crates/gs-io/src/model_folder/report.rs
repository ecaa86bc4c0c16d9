//! [`ModelReport`]: what was found in a model folder, and what was decided.

use super::flags::FlagReport;
use super::iteration::{Iteration, Stage};
use crate::repair::{RepairReport, Sanitized};
use std::path::PathBuf;

/// The static and dynamic parts of a Swift4D model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Split {
    /// Splats declared dynamic.
    pub num_dynamic: usize,
    /// Of these, how many lie in the field's box: only they move.
    pub num_moving: usize,
}

/// What a model folder holds, and where every decision comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelReport {
    /// Which iteration.
    pub iteration: u64,
    /// Its stage.
    pub stage: Stage,
    /// The PLY file read.
    pub ply: PathBuf,
    /// `N`, after dropping damaged rows.
    pub num_splats: usize,
    /// SH degree.
    pub sh_degree: usize,
    /// Damaged rows of the PLY.
    pub repair: RepairReport,
    /// Rows of the PLY that were kept, if any were dropped.
    pub kept_rows: Option<Vec<usize>>,
    /// Width `W` of the network; 0 without one.
    pub width: usize,
    /// Plane channels `C`; features per level of a hash grid.
    pub channels: usize,
    /// Resolution levels `L`.
    pub levels: usize,
    /// Layers of the trunk.
    pub depth: usize,
    /// Heads in use, names as in the checkpoint.
    pub heads: Vec<&'static str>,
    /// Which mask multiplies the stored parameters.
    pub mask: &'static str,
    /// What the model itself declares dynamic, if it does.
    pub split: Option<Split>,
    /// Flags of the training run.
    pub flags: Vec<FlagReport>,
    /// Background of the training images, if `cfg_args` says so (the reference's default is white).
    pub white_background: Option<bool>,
    /// Heads whose weights never left their random initialisation (a hint, not a decision).
    pub untrained_heads: Vec<&'static str>,
    /// What was read otherwise than stored, or not understood and not needed.
    pub notes: Vec<String>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

impl ModelReport {
    pub(crate) fn new(iteration: &Iteration, ply: PathBuf, sanitized: &Sanitized) -> Self {
        let found = &sanitized.report;
        let warning = found.warning(sanitized.kept.is_some());
        let warnings =
            warning.map(|warning| format!("{}: {warning}", ply.display())).into_iter().collect();
        let notes = found.infinities.note().into_iter().collect();
        Self {
            iteration: iteration.number,
            stage: iteration.stage,
            ply,
            num_splats: sanitized.splats.len(),
            sh_degree: sanitized.splats.sh_degree,
            repair: sanitized.report,
            kept_rows: sanitized.kept.clone(),
            width: 0,
            channels: 0,
            levels: 0,
            depth: 0,
            heads: Vec::new(),
            mask: "none",
            split: None,
            flags: Vec::new(),
            white_background: None,
            untrained_heads: Vec::new(),
            notes,
            warnings,
        }
    }
}
