//! Metrics of edited dynamic scenes: images ([`psnr()`], [`Ssim`] with its gradient, [`ms_ssim()`],
//! [`flip()`]), what an edit preserves ([`EditedImage`]), change over time ([`warp_error()`],
//! [`StaticFlicker`], [`motion_fidelity()`]) and motion of splats ([`MotionTrack`], [`drift()`],
//! [`isometry()`], [`neighborhood_distance_deviation`], [`match_statistics()`]).
//!
//! Each function documents its formula, its unit and whether higher is better. Deliberately absent:
//! files, rendering, neural weights and pass/fail thresholds.

mod direction;
mod drift;
mod flicker;
mod flip;
mod flow_field;
mod halved;
mod isometry;
mod jitter;
mod mask;
mod match_statistics;
mod motion_fidelity;
mod ms_ssim;
mod ndd;
mod neighbors;
mod preservation;
mod psnr;
mod ssim;
mod track;
mod warp_error;

pub use direction::Better;
pub use drift::{Drift, drift};
pub use flicker::{StaticFlicker, mean_absolute_difference, temporal_flickering};
pub use flip::{FLIP_PIXELS_PER_DEGREE, flip, flip_map};
pub use flow_field::FlowField;
pub use halved::{add_halved_adjoint, halved, pixels_under};
pub use isometry::isometry;
pub use mask::dilated;
pub use match_statistics::{Match, MatchStatistics, match_statistics};
pub use motion_fidelity::motion_fidelity;
pub use ms_ssim::{MS_SSIM_MIN_SIDE, MS_SSIM_WEIGHTS, ms_ssim};
pub use ndd::{NDD_NEIGHBORS, deviation_among, neighborhood_distance_deviation};
pub use neighbors::{PointNeighbors, nearest};
pub use preservation::EditedImage;
pub use psnr::psnr;
pub use ssim::{SSIM_RADIUS, Ssim, SsimBorder};
pub use track::MotionTrack;
pub use warp_error::warp_error;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
