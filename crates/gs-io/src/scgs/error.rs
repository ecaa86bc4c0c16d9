//! [`ScgsError`]: errors of reading a model of SC-GS.

use crate::deformable3dgs::Deformable3dgsError;
use crate::pth::LayersError;
use gs_deform::FieldError;
use thiserror::Error;

/// Error of reading a model of SC-GS.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ScgsError {
    /// Trained with an option that is not supported.
    #[error(
        "has {option}=True, an option of SC-GS that is not supported; train without it, or export \
        the scene as a PLY sequence from its own viewer"
    )]
    Unsupported {
        /// Name of the option.
        option: &'static str,
    },
    /// `nodes` has a different shape.
    #[error("`nodes` has shape {shape:?}, expected [nodes, 3 or more]")]
    Nodes {
        /// Its shape.
        shape: Vec<usize>,
    },
    /// Nodes and splats have different numbers of hyper coordinates.
    #[error(
        "its nodes have {hyper} hyper coordinates, but point_cloud.ply has {columns} columns fea_0, fea_1, …, expected {hyper}, or {} with a motion mask; the files belong to different runs, or an editor dropped the columns; copy both again from the machine that trained the model",
        hyper + 1
    )]
    HyperCoordinates {
        /// Those of the nodes.
        hyper: usize,
        /// Columns of the PLY.
        columns: usize,
    },
    /// The number of nodes per splat is out of range.
    #[error("cfg_args has K out of range, expected 1 to {largest}")]
    Neighbors {
        /// Largest number accepted.
        largest: u64,
    },
    /// The network is of a different kind.
    #[error(transparent)]
    Network(#[from] Deformable3dgsError),
    /// A tensor is missing or has a different shape.
    #[error("{0}")]
    Layers(#[from] LayersError),
    /// The tensors do not form a deformation field.
    #[error("{0}")]
    Field(#[from] FieldError),
}
