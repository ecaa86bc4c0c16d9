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
    /// End-point error of splats whose geometry was edited.
    pub(super) epe_edited: f64,
    pub(super) p95: f64,
    pub(super) bad5: f64,
    pub(super) contact: f64,
    pub(super) rot_deg: f64,
    /// Rotation error of splats whose true motion is that of one rigid bone, degrees.
    pub(super) rot_rigid_deg: f64,
    pub(super) lns: f64,
    /// Jitter relative to the ground truth's.
    pub(super) jitter_ratio: f64,
    /// Jitter of the source scene relative to that of the scene without noise.
    pub(super) jitter_ratio_source: f64,
    pub(super) ndd: f64,
    pub(super) ndd_truth: f64,
    pub(super) psnr: f64,
    pub(super) seconds: f64,
}
