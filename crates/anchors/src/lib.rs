//! Regions of a point cloud: line-sampled anchors (Eqs. 5–7 of the Catalyst4D paper), and cells
//! of points that move together.
//!
//! [`AnchorSet`] needs one frame, [`Cells`] need trajectories.
//!
//! A cloud is divided into small neighbourhoods, and random lines are drawn through its bounding
//! sphere. A neighbourhood that fits entirely into a thin cylinder around some line yields one
//! anchor, a weighted centroid. Outliers, whose neighbourhoods are wider than the typical one,
//! yield none. Two clouds sampled with the *same* lines have comparable anchors.
//!
//! ```
//! use anchors::{AnchorParams, AnchorSet};
//!
//! let cloud: Vec<[f32; 3]> = (0..400)
//!     .map(|i| {
//!         let (row, column) = ((i / 20) as f32, (i % 20) as f32);
//!         [column + 0.3 * row.sin(), row + 0.3 * column.cos(), (row * column).sin()]
//!     })
//!     .collect();
//! let anchors = AnchorSet::of(&cloud, &AnchorParams { num_lines: 20_000, ..Default::default() })?;
//! assert!(anchors.len() > 50 && anchors.num_uncovered() < 250);
//! # Ok::<(), anchors::AnchorError>(())
//! ```
//!
//! # Guarantees
//! - Input `&[[f32; 3]]` or `&[[f64; 3]]`, arithmetic in `f64`, world units throughout.
//! - Bit-identical results for any number of threads; equal results, bits and order of the anchors
//!   included, for any order of the input points.
//! - Exact: the sphere is minimal, neighbours are nearest, no line that hits is missed.
//! - Degenerate clouds have defined results: one point, coincident, collinear and coplanar points,
//!   clouds smaller than a neighbourhood (see [`Neighborhoods::build`], [`AnchorSet::build`]).
//! - Non-finite input is an error; no input cloud leads to a panic.
//!
//! # Deliberately absent
//! Gaussians, colour, correspondence between regions, file formats, GPU.

#![expect(
    clippy::cast_possible_truncation,
    reason = "ids are u32; every entry point rejects clouds that 32 bits cannot index"
)]

mod anchor_set;
mod cells;
mod cylinder;
mod error;
mod farthest;
mod grid;
mod groups;
mod kdtree;
mod lines;
mod median;
mod nearest;
mod neighborhoods;
mod params;
mod points;
mod rng;
mod sphere;
mod trajectories;
mod vec3;

pub use anchor_set::{AnchorSet, NO_ANCHOR, NO_LINE};
pub use cells::{CellParams, Cells, NO_CELL};
pub use error::AnchorError;
pub use kdtree::{KdTree, Neighbor};
pub use lines::{Line, Lines, expected_hits, lines_for_hits};
pub use nearest::median_spacing;
pub use neighborhoods::{Neighborhoods, normal_feature};
pub use params::{AnchorParams, Grouping, Radius};
pub use points::Coordinate;
pub use sphere::BoundingSphere;
pub use trajectories::{NEIGHBORS, NOISE_REACH, Neighbors, RigidNeighbors, Trajectories};

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
