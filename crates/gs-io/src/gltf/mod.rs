//! glTF 2.0 with Gaussian splats (`KHR_gaussian_splatting`, ratified by Khronos): reading and
//! writing one frame as `.glb` or `.gltf`.
//!
//! Splats are point primitives with one attribute each for centre, rotation (`xyzw`), standard
//! deviations (linear), opacity (linear) and every SH coefficient (the 3DGS basis). Attributes may
//! be quantised, sparse and interleaved; transformations of nodes are applied. Embedded SPZ
//! (`KHR_gaussian_splatting_compression_spz`, also `_2`) is read.
//!
//! Axes: glTF defines the sides of an asset as left (x), up (y), front (z),
//! [`Axes::LUF`](crate::Axes::LUF); splat-transform writes that, others RUB, or the axes of a PLY
//! unchanged. See [`AxesReading`](crate::AxesReading).

mod accessor;
mod container;
mod document;
mod ellipsoid;
mod error;
mod extension;
mod node;
mod primitive;
mod read;
mod write;

pub use error::GltfError;
pub use read::{External, read};
pub use write::{WriteOptions, write};
