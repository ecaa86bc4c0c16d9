//! [`ModelScene`] of a model folder.

use super::ModelReport;
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use gs_deform::{HashGridScene, HexPlaneScene, StaticScene};

/// The scene of a model folder.
#[derive(Debug)]
pub enum ModelScene {
    /// With its deformation network.
    Deformed(Box<HexPlaneScene>),
    /// With its hash grid, which moves some of the splats: a Swift4D model.
    HashGrid(Box<HashGridScene>),
    /// Saved in the coarse stage, before any deformation.
    Static(StaticScene),
}

impl ModelScene {
    /// The scene as a trait object.
    pub fn as_dyn(&self) -> &dyn DynamicScene {
        match self {
            Self::Deformed(scene) => &**scene,
            Self::HashGrid(scene) => &**scene,
            Self::Static(scene) => scene,
        }
    }

    /// The splats as stored, before any deformation.
    pub fn canonical(&self) -> &Splats {
        match self {
            Self::Deformed(scene) => scene.canonical(),
            Self::HashGrid(scene) => scene.canonical(),
            Self::Static(scene) => scene.splats(),
        }
    }
}

impl DynamicScene for ModelScene {
    fn num_splats(&self) -> usize {
        self.as_dyn().num_splats()
    }

    fn sh_degree(&self) -> usize {
        self.as_dyn().sh_degree()
    }

    fn time_range(&self) -> TimeRange {
        self.as_dyn().time_range()
    }

    fn num_frames(&self) -> Option<usize> {
        self.as_dyn().num_frames()
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.as_dyn().at_into(t, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.as_dyn().geometry_into(t, out)
    }

    fn fades(&self) -> bool {
        self.as_dyn().fades()
    }

    fn dynamic_mask(&self) -> Option<&[bool]> {
        self.as_dyn().dynamic_mask()
    }
}

/// An opened model folder.
#[derive(Debug)]
pub struct Model {
    /// The scene, at times from 0.
    pub scene: ModelScene,
    /// Contents and resolved settings.
    pub report: ModelReport,
}
