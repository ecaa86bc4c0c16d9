//! [`RefineReport`]: counts, losses and timings.

use crate::{RepairCounts, SupervisionStats, problem::TracePoint, view_sampler::ViewTime};

/// Counts, losses and timings of a refinement. Losses are Eq. 20, means over images; only pixels
/// that an edited splat reaches contribute.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct RefineReport {
    /// Edited splats.
    pub num_edited: usize,
    /// Edited splats that are visible in an image.
    pub num_visible: usize,
    /// Counts of the repair ([`crate::refine_edit()`]).
    pub repair: RepairCounts,
    /// Images used as supervision.
    pub samples: Vec<ViewTime>,
    /// Images that are only evaluated.
    pub held_out: Vec<ViewTime>,
    /// Loss before refinement.
    pub loss_before: f64,
    /// Loss after refinement.
    pub loss_after: f64,
    /// Loss on held-out images before refinement; 0 without such images.
    pub held_out_before: f64,
    /// Loss on held-out images after refinement.
    pub held_out_after: f64,
    /// Before and after: the parts of `held_out_before` and `held_out_after` due to artifacts
    /// (Eq. 18); the rest is due to changes of colour elsewhere.
    pub held_out_artifacts: [f64; 2],
    /// Counts of masked pixels that frame 1 supervises, and of the others by reason.
    pub supervision: SupervisionStats,
    /// Images in which [`crate::RefineOptions::min_uncertainty`], not ε·mean(U), is the mask's
    /// threshold.
    pub num_floored: usize,
    /// The loss over the run, one point per pass.
    pub trace: Vec<TracePoint>,
    /// Wall-clock seconds per part of the work, by name.
    pub timings: Vec<(&'static str, f64)>,
    /// Bytes of images and prepared states, as estimated for the budget.
    pub bytes: usize,
    /// Images whose prepared state was kept.
    pub num_cached: usize,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}
