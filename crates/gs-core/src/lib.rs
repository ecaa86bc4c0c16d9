//! Data and maths of Gaussian splats, shared by every crate of the workspace.
//!
//! Contents: [`Splats`] (structure of arrays of *stored* parameters), [`Camera`], spherical
//! harmonics, covariances, activations, float images, the traits [`DynamicScene`] and
//! [`Rasterizer`] that connect the other crates, and the workspace's quantiles, seeded random
//! numbers and fingerprints.
//!
//! Deliberately absent: files, paths, GPU, command line, training.
//!
//! Conventions: quaternions are `wxyz`; world units are those of the scene; the camera frame is
//! OpenCV's (x right, y down, z forward); pixel centres lie at half-integers (image centre =
//! `width / 2`).

pub mod activation;
mod camera;
mod covariance;
mod extent;
mod fnv1a;
mod footprint;
mod image;
pub mod image_formation;
mod precision;
mod projected_weight;
mod quantile;
pub mod quat;
mod random;
mod raster;
mod real;
mod scene;
pub mod sh;
mod sh_rotation;
mod splats;
mod symmetric_eigen;
mod tile_set;

pub use camera::{Camera, CameraError, Intrinsics};
pub use covariance::{covariance, rotation_matrix};
pub use extent::{Extent, WeightedPoint, weighted_points};
pub use fnv1a::Fnv1a;
pub use footprint::Footprint;
pub use image::{Image, ImageError};
pub use precision::{Precision, RowPrecision};
pub use projected_weight::{projected_axes, unoccluded_weight, visible_share};
pub use quantile::{median, nearest_rank, quantile, weighted_quantile};
pub use random::{SplitMix64, standard_normal};
pub use raster::{
    GradientConvention, RasterError, Rasterizer, RenderGrads, RenderOutput, RenderParams,
    UpstreamGrads, check_tiles,
};
pub use real::{Real, Ring};
pub use scene::{DynamicScene, SceneError, TimeRange};
pub use sh_rotation::ShRotation;
pub use splats::{Splats, SplatsError};
pub use symmetric_eigen::symmetric_eigen;
pub use tile_set::TileSet;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeDoctests;
