//! Multiplication by the Gibbs kernel `K_ij = exp(−D_ij/λ0)`, in logarithms.

mod blocks;
mod dense;
mod gibbs;
mod sparse;

pub(crate) use blocks::BlockKernel;
pub(crate) use dense::{DenseKernel, LogDenseKernel, MAX_SCALED_RANGE};
pub(crate) use gibbs::Kernel;
pub(crate) use sparse::SparseKernel;
