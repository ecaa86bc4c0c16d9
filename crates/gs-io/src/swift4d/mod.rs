//! Model folders of Swift4D: canonical PLY with a dynamic score per Gaussian, hash-grid field,
//! flags of the training run.
//!
//! A folder is read like one of 4DGaussians ([`crate::checkpoint4dgs`]), with `FDHash.pth` instead
//! of `deformation.pth`, and gives the same kind of [`Model`](crate::model_folder::Model). Flags
//! that cannot be inferred from the tensors are taken, in this order, from overrides, `cfg_args`,
//! hints in the tensors, or defaults. The index rule of the grid is not stored in any file. It
//! matters only for large tables, and is then inferred from unchanged table entries.

mod error;
mod flags;
mod index_rule;
mod network;
mod read;
mod settings;

pub use error::Swift4dError;
pub(crate) use read::looks_like_model;
pub use read::open;
