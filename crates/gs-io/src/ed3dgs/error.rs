//! [`Ed3dgsError`]: errors of reading a network of E-D3DGS.

use crate::pth::LayersError;
use gs_deform::FieldError;
use thiserror::Error;

/// Error of reading a network of E-D3DGS.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Ed3dgsError {
    /// Tensors of a different kind.
    #[error(
        "is not the deformation network of E-D3DGS: it has no `feature_out_f.0.weight`, but {found}; the PLY next to it has embeddings, so the files belong to different models; copy both again from the machine that trained the model"
    )]
    OtherNetwork {
        /// Number and names of the tensors found.
        found: String,
    },
    /// The table of times has a different shape.
    #[error("`weight` has shape {shape:?}, expected {expected}")]
    Table {
        /// Its shape.
        shape: Vec<usize>,
        /// The shape expected.
        expected: &'static str,
    },
    /// `cfg_args` resamples the table of times to an impossible number of rows.
    #[error(
        "its table of times would have {rows} rows, expected 1 or more; check min_embeddings, max_embeddings and c2f_temporal_iter in cfg_args"
    )]
    TableRows {
        /// Number of rows.
        rows: f64,
    },
    /// A tensor is missing or has a different shape.
    #[error("{0}")]
    Layers(#[from] LayersError),
    /// The tensors do not form a deformation field.
    #[error("{0}")]
    Field(#[from] FieldError),
}
