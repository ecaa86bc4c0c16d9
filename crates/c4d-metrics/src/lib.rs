//! Metrics of edited dynamic scenes: images ([`psnr`], [`Ssim`] with its gradient) and motion
//! ([`MotionTrack`]).
//!
//! Each function documents its formula, its unit and whether higher is better. Deliberately absent:
//! files, rendering, neural weights and pass/fail thresholds.

mod image;
mod motion;
mod ssim;

pub use image::psnr;
pub use motion::{MotionTrack, neighbourhood_distance_deviation};
pub use ssim::{SSIM_RADIUS, Ssim, SsimBorder};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
