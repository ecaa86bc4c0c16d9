//! Steps of the appearance refinement in WGSL compute shaders (`shaders/train/`).
//!
//! [`DeviceDescent`] is the engine of `cuar`'s Adam: with it, [`cuar::refine_with`] keeps images,
//! gradients and moments on the device. A step (forward, losses, backward, Adam) is one submission.
//!
//! Promises: masked L1, SSIM (11×11 Gaussian window, separable) and Adam have the values, gradients
//! and conventions of `cuar`'s on the CPU, within single precision. Shaders are core WGSL within
//! WebGPU's default limits. Sums have a fixed order.
//!
//! Deliberately absent: densification, schedules, files, the choice of images.

pub mod kernels;

mod adam;
mod descent;
mod descent_memory;
mod image_loss;
mod weights;

pub use adam::{DeviceAdam, ParameterSlice};
pub use descent::DeviceDescent;
pub use image_loss::{DeviceImage, ImageLosses};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
