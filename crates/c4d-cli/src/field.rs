//! A scene's own deformation network, asked about splats it was not trained on (the paper's
//! baseline "w/o AMG").

use amg::FieldAt;
use gs_core::{DynamicScene, SceneError, Splats};
use gs_deform::{FieldError, HashGridScene, HexPlaneScene};
use std::sync::Arc;

/// A model's network with its canonical splats.
#[derive(Debug, Clone)]
pub(crate) enum Network {
    /// Of a 4DGaussians model.
    HexPlane(Arc<HexPlaneScene>),
    /// Of a Swift4D model.
    HashGrid(Arc<HashGridScene>),
}

impl Network {
    /// The splats as stored, before any deformation.
    pub(crate) fn canonical(&self) -> &Splats {
        match self {
            Self::HexPlane(scene) => scene.canonical(),
            Self::HashGrid(scene) => scene.canonical(),
        }
    }

    /// `rest` under the network. A hash grid is asked about all of `rest`: its model says of its
    /// own splats only which are dynamic.
    fn scene_of(&self, rest: &Splats) -> Result<Box<dyn DynamicScene>, FieldError> {
        Ok(match self {
            Self::HexPlane(scene) => {
                Box::new(HexPlaneScene::new(rest.clone(), scene.field().clone())?)
            }
            Self::HashGrid(scene) => {
                let all = vec![true; rest.len()];
                Box::new(HashGridScene::new(rest.clone(), all, scene.field().clone())?)
            }
        })
    }
}

/// Adapts a network to the hook of `amg`.
#[derive(Debug)]
pub(crate) struct NetworkField(pub(crate) Network);

impl FieldAt for NetworkField {
    fn displace_into(&self, rest: &Splats, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let source = |error: FieldError| SceneError::Source {
            what: "deformation network at the edited positions".to_owned(),
            source: Box::new(error),
        };
        // The network's SH head adds degree-3 coefficients; the edit keeps its own colours in this
        // baseline.
        self.0.scene_of(rest).map_err(source)?.geometry_into(t, out)?;
        out.opacity_logits.clone_from(&rest.opacity_logits);
        out.sh.clone_from(&rest.sh);
        out.sh_degree = rest.sh_degree;
        Ok(())
    }
}
