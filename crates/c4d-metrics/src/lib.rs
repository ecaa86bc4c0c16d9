//! Metrics of edited dynamic scenes that need no neural weights.
//!
//! One meaning per number: each function states its formula, its unit and whether more is better. Deliberately absent: files,
//! rendering, thresholds that decide.

mod image;
mod motion;

pub use image::psnr;
pub use motion::{MotionTrack, neighbourhood_distance_deviation};
