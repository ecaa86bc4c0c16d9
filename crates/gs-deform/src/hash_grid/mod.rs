//! Deformation by a four-dimensional multi-resolution hash grid, as in Swift4D models.
//!
//! Position in a box and time index a table of features at several resolutions ([`HashGrid`]); two
//! fused layers and five heads map the features to additive changes of the stored parameters
//! ([`HashGridField`]). Only Gaussians that are declared dynamic and lie in the box are evaluated;
//! all others keep their stored values ([`HashGridScene`]).

mod encode;
mod evaluate;
mod field;
mod grid;
mod level;
mod scene;
mod segments;

pub use field::{FieldBox, HashGridField, HashGridNetwork};
pub use grid::{GridShape, HashGrid};
pub use level::{IndexRule, Level};
pub use scene::HashGridScene;
