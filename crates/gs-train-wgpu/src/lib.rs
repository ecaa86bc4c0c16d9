//! Losses and optimiser of image-based training in WGSL compute shaders (`shaders/train/`), and
//! whole steps on the device.
//!
//! Promises: masked L1, SSIM (11×11 Gaussian window, separable) and Adam with the values, gradients
//! and conventions of the CPU ones in `cuar`, within single precision, in core WGSL within WebGPU's
//! default limits, with sums in a fixed order. [`Trainer::step`] is one submission: forward →
//! losses → backward → Adam. Nothing is read back but, when asked, the losses and the parameters.
//!
//! [`DeviceDescent`] is such a step for `cuar`'s refinement: with it, [`cuar::refine_with`] keeps
//! images, gradients and moments on the device.
//!
//! Deliberately absent: densification, schedules, files, the choice of images.

pub mod kernels;

mod adam;
mod descent;
mod descent_memory;
mod image_loss;
mod targets;
mod trainer;

pub use adam::DeviceAdam;
pub use descent::DeviceDescent;
pub use image_loss::{ImageLosses, Plane};
pub use targets::Targets;
pub use trainer::{Rates, StepLosses, TrainOptions, Trainer, Weights};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
