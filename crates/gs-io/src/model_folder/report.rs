//! [`ModelReport`]: contents of a model folder and the resolved settings.

use super::flags::FlagReport;
use super::iteration::{Iteration, Stage};
use crate::repair::{RepairReport, Sanitized};
use std::path::PathBuf;

/// The static and dynamic parts of a Swift4D model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DynamicSplitCounts {
    /// Splats declared dynamic.
    pub num_dynamic: usize,
    /// Number of these in the field's box; only they move.
    pub num_moving: usize,
}

/// Contents of a model folder, and the resolved settings with their origin.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ModelReport {
    /// Iteration number.
    pub iteration: u64,
    /// Stage of the iteration.
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
    /// Number of layers of the trunk.
    pub depth: usize,
    /// Heads in use, names as in the checkpoint.
    pub heads: Vec<&'static str>,
    /// Mask that multiplies the stored parameters.
    pub mask: &'static str,
    /// Splats that the model declares dynamic, if it does.
    pub split: Option<DynamicSplitCounts>,
    /// Flags of the training run.
    pub flags: Vec<FlagReport>,
    /// Whether the background of the training images is white, if `cfg_args` states it (the
    /// reference's default is white).
    pub white_background: Option<bool>,
    /// Heads whose weights are within the bounds of random initialisation (only a hint).
    pub untrained_heads: Vec<&'static str>,
    /// Values that were read differently from how they are stored, or ignored.
    pub notes: Vec<String>,
    /// Warnings for the user.
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
