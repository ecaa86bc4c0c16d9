//! [`Checkpoint4dgsError`]: errors of reading a model of 4DGaussians.

use thiserror::Error;

/// Error of reading a model of 4DGaussians.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Checkpoint4dgsError {
    /// The tensors do not form its deformation network.
    #[error("{0}")]
    Network(String),
    /// The flags of the training run are unknown, contradict the network, or cannot be evaluated.
    #[error("{0}")]
    Flags(String),
    /// The table of moving splats has a different length than the PLY.
    #[error("has {found} entries, but point_cloud.ply has {rows} rows")]
    Table {
        /// Its length.
        found: usize,
        /// Rows of the PLY.
        rows: usize,
    },
}
