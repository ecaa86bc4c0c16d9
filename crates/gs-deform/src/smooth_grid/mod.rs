//! Deformation fields of Grid4D and DASH: hash grids of space and time with smoothstep weights, and
//! a small network on their features.

mod field;
mod grid;
mod scene;

pub use field::{Attention, SmoothGridField, SmoothGridNetwork};
pub use grid::{SmoothGrid, SmoothGridParts};
pub use scene::{MovingRows, SmoothGridScene};
