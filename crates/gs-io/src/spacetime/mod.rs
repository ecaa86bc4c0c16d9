//! PLY files of Spacetime Gaussians (Li et al. 2024), lite model: splats that move along cubic
//! polynomials of time and fade in and out.
//!
//! Columns in addition to those of 3DGS: `trbf_center`, `trbf_scale` (logarithm of the time after
//! which opacity has fallen to 1/e), `motion_0 … motion_8` (coefficients of the first, second and
//! third power of time), `omega_0 … omega_3`. `f_dc_0 … f_dc_2` are plain RGB. Times are (frame −
//! start)/duration, so that the last frame of n is at (n−1)/n.
//!
//! The full model has nine colour features and a decoder that depends on the ray of a pixel; it
//! cannot be represented as splats and is rejected.

mod error;
mod read;

pub use error::SpacetimeError;
pub(crate) use read::has_columns;
pub use read::open;
