//! Model folders of SC-GS (Huang et al. 2024): splats driven by control nodes.
//!
//! The layout is that of [`crate::deformable3dgs`]. The PLY has columns `fea_0 …`: hyper
//! coordinates, and a last one for the motion mask if it was trained with one. `deform.pth`
//! contains the nodes and the network.

mod error;
mod read;

pub use error::ScgsError;
pub use read::open;
