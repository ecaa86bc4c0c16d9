//! Model folders of 4DGaussians: canonical PLY, deformation network, flags of the training run.
//!
//! Flags that cannot be inferred from the tensors are taken, in this order, from overrides,
//! `cfg_args`, the published configurations, or defaults;
//! [`ModelReport`](crate::model_folder::ModelReport) lists the origin of each.

mod describe;
mod error;
mod flags;
mod network;
mod network_shape;
mod read;
mod write;

pub use error::Checkpoint4dgsError;
pub use read::open;
pub use write::write;
