//! Model folders of Deformable-3D-Gaussians (Yang et al. 2024), and of
//! methods with the same format, such as TimeFormer.
//!
//! `point_cloud/iteration_N/point_cloud.ply` contains canonical splats,
//! `deform/iteration_M/deform.pth` a fully connected network; the newest of each is used, as in the
//! reference. The variants (time network of the Blender configuration, six degrees of freedom) and
//! all widths are inferred from the tensors; `cfg_args` provides only the background.

mod error;
mod network;
mod read;

pub use error::Deformable3dgsError;
pub(crate) use network::network;
pub(crate) use read::UP_SYNTHETIC;
pub use read::open;
