//! [`SpacetimeError`]: errors of reading a PLY of Spacetime Gaussians.

use thiserror::Error;

/// Error of reading a PLY of Spacetime Gaussians.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SpacetimeError {
    /// The full model, whose colours are not spherical harmonics.
    #[error(
        "is of the full model of Spacetime Gaussians, whose colours come from a decoder that \
        depends on the ray of each pixel, so it cannot be represented as splats; train the lite \
        model (model=ours_lite), or export a .splatv from it"
    )]
    FullModel,
}
