//! Model folders of Grid4D (Xu et al. 2024) and DASH (Chen et al.
//! 2025): hash grids over space and time.
//!
//! The layout is that of [`crate::deformable3dgs`]; `deform.pth` is a tuple of the grids' and the
//! network's tensors. DASH has one grid with four axes, and a column `dynamic` in the PLY; the
//! other splats are static. `cfg_args` contains the size of the cube covered by the grids.

mod error;
mod grids;
mod read;

pub use error::Grid4dError;
pub use read::{open, open_dash};
