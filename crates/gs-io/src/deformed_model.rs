//! [`DeformedModel`]: canonical splats with the deformation network that moves them.

use gs_core::Splats;
use gs_deform::{HashGridScene, HexPlaneScene};
use std::sync::Arc;

/// Canonical splats with a deformation network that can be evaluated at other positions.
#[derive(Debug, Clone)]
pub enum DeformedModel {
    /// Of a 4DGaussians model.
    HexPlane(Arc<HexPlaneScene>),
    /// Of a Swift4D model.
    HashGrid(Arc<HashGridScene>),
}

impl DeformedModel {
    /// The splats as stored, before any deformation.
    pub fn canonical(&self) -> &Splats {
        match self {
            Self::HexPlane(scene) => scene.canonical(),
            Self::HashGrid(scene) => scene.canonical(),
        }
    }
}
