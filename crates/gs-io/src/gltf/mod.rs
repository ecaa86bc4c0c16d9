//! glTF 2.0 with Gaussian splats (`KHR_gaussian_splatting`, ratified by Khronos): `.glb` and
//! `.gltf` in and out, one frame.
//!
//! Splats are point primitives with an attribute each for centre, rotation (`xyzw`), standard
//! deviations (linear), opacity (linear) and every SH coefficient (the 3DGS basis). Attributes may
//! be quantised, sparse and interleaved; nodes place, turn and scale them, and all of that is
//! applied. SPZ inside (`KHR_gaussian_splatting_compression_spz`, also `_2`) is read.
//!
//! Axes: glTF names the sides of an asset left (x), up (y), front (z),
//! [`Axes::LUF`](crate::Axes::LUF); splat-transform writes that, others RUB, or the axes of a PLY
//! unchanged. See [`AxesReading`](crate::AxesReading).

mod accessor;
mod container;
mod document;
mod ellipsoid;
mod extension;
mod node;
mod primitive;
mod read;
mod write;

pub use read::{External, read};
pub use write::{WriteOptions, write};
