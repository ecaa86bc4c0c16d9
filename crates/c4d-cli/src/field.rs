//! A scene's own deformation network, evaluated for splats outside its
//! training (the paper's baseline "w/o AMG").

use amg::FieldAt;
use gs_core::{DynamicScene, SceneError, Splats};
use gs_deform::{FieldError, HashGridScene, HexPlaneScene};
use gs_io::DeformedModel;

/// Adapter of a network to the interface of `amg`.
#[derive(Debug)]
pub(crate) struct NetworkField(pub(crate) DeformedModel);

impl FieldAt for NetworkField {
    fn displace_into(&self, rest: &Splats, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let source = |error: FieldError| SceneError::Source {
            what: "deformation network at the edited positions".to_owned(),
            source: Box::new(error),
        };
        // The network's SH head adds degree-3 coefficients; the edit keeps its own colours in this
        // baseline.
        deformed(rest, &self.0).map_err(source)?.geometry_into(t, out)?;
        out.opacity_logits.clone_from(&rest.opacity_logits);
        out.sh.clone_from(&rest.sh);
        out.sh_degree = rest.sh_degree;
        Ok(())
    }
}

/// `rest` deformed by the network of `model`. A hash grid deforms all of `rest`, because its model
/// has dynamic flags only for its own splats.
fn deformed(rest: &Splats, model: &DeformedModel) -> Result<Box<dyn DynamicScene>, FieldError> {
    Ok(match model {
        DeformedModel::HexPlane(scene) => {
            Box::new(HexPlaneScene::new(rest.clone(), scene.field().clone())?)
        }
        DeformedModel::HashGrid(scene) => {
            let all = vec![true; rest.len()];
            Box::new(HashGridScene::new(rest.clone(), all, scene.field().clone())?)
        }
    })
}
