//! [`Score`] of a method.

use super::method::Method;
use serde::Serialize;

/// One scene, one method. Lengths in % of the figure's size.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Score {
    pub(super) case: &'static str,
    pub(super) seed: u64,
    pub(super) method: Method,
    pub(super) epe: f64,
    /// Of splats whose geometry was edited.
    pub(super) epe_edited: f64,
    pub(super) p95: f64,
    pub(super) bad5: f64,
    pub(super) contact: f64,
    pub(super) rot_deg: f64,
    /// Where the true motion is that of one rigid bone.
    pub(super) rot_rigid_deg: f64,
    pub(super) lns: f64,
    /// Relative to the truth's.
    pub(super) jitter_ratio: f64,
    /// The same for the source scene, relative to that without noise.
    pub(super) jitter_ratio_source: f64,
    pub(super) ndd: f64,
    pub(super) ndd_truth: f64,
    pub(super) psnr: f64,
    pub(super) seconds: f64,
}
