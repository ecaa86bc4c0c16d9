//! A scene's own deformation network, asked about splats it was not trained on (the paper's baseline "w/o AMG").

use amg::FieldAt;
use gs_core::{DynamicScene, SceneError, Splats};
use gs_deform::HexPlaneScene;
use std::sync::Arc;

/// Adapts a HexPlane network to the hook of `amg`.
#[derive(Debug)]
pub(crate) struct NetworkField(pub(crate) Arc<HexPlaneScene>);

impl FieldAt for NetworkField {
    fn displace_into(&self, rest: &Splats, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let source = |error: gs_deform::FieldError| SceneError::Source {
            what: "deformation network at the edited positions".to_owned(),
            source: Box::new(error),
        };
        // The network's SH head adds degree-3 coefficients; the edit keeps its own colours in this baseline.
        let field = self.0.field().clone();
        HexPlaneScene::new(rest.clone(), field).map_err(source)?.geometry_into(t, out)?;
        out.opacity_logits.clone_from(&rest.opacity_logits);
        out.sh.clone_from(&rest.sh);
        out.sh_degree = rest.sh_degree;
        Ok(())
    }
}
