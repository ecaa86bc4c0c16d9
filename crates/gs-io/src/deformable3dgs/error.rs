//! [`Deformable3dgsError`]: errors of reading a network of Deformable-3D-Gaussians.

use crate::pth::LayersError;
use gs_deform::FieldError;
use thiserror::Error;

/// Error of reading a network of Deformable-3D-Gaussians.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Deformable3dgsError {
    /// Trained with a hash grid instead of its encoding.
    #[error(
        "holds `{name}`: it was trained with a hash grid instead of its encoding, which is not \
        supported; train without `use_hash`, or export the scene as a PLY sequence from its own \
        viewer"
    )]
    HashGrid {
        /// Name of the grid's tensor.
        name: String,
    },
    /// Tensors of a different kind.
    #[error(
        "is not a supported deformation network: it has no `{missing}`, but {found}; expected one \
        of Deformable-3D-Gaussians, SC-GS, Grid4D or DASH"
    )]
    OtherNetwork {
        /// Name of the first layer's weights.
        missing: String,
        /// Number and names of the tensors found.
        found: String,
    },
    /// A tensor is missing or has a different shape.
    #[error("{0}")]
    Layers(#[from] LayersError),
    /// The tensors do not form a deformation field.
    #[error("{0}")]
    Field(#[from] FieldError),
}
