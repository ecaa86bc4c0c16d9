//! Reading a checkpoint.

use super::GsplatError;
use crate::pth::{self, Layers, LayersError};
use gs_core::{Splats, sh};

/// Unsupported parameters that affect the appearance.
const UNSUPPORTED: [&str; 3] = ["features", "colors", "color_velocities"];
/// Reads a checkpoint of one frame.
///
/// # Errors
/// If the bytes are of a different kind, or a dynamic scene.
pub(crate) fn read(bytes: &[u8]) -> Result<Splats, GsplatError> {
    let tensors = pth::read(bytes).and_then(pth::Root::into_state_dict)?;
    let layers = Layers::new(pth::siblings_of(tensors, &["means"]));
    if layers.has("times") {
        return Err(GsplatError::Moving);
    }
    splats(&layers)
}

/// One value per splat, `[N]` or `[N, 1]`.
pub(crate) fn column(layers: &Layers<'_>, name: &str, n: usize) -> Result<Vec<f32>, LayersError> {
    let tensor = layers.need(name)?;
    match *tensor.shape() {
        [rows] | [rows, 1] if rows == n => Ok(tensor.to_f32s()),
        ref shape => Err(LayersError::Shape {
            name: name.to_owned(),
            found: shape.to_vec(),
            expected: vec![n, 1],
        }),
    }
}

/// The splats of a checkpoint.
pub(crate) fn splats(layers: &Layers<'_>) -> Result<Splats, GsplatError> {
    if let Some(name) = UNSUPPORTED.iter().find(|name| layers.has(name)) {
        return Err(GsplatError::Colors { name });
    }
    let &[n, 3] = layers.need("means")?.shape() else {
        return Err(GsplatError::Means { shape: layers.need("means")?.shape().to_vec() });
    };
    if n == 0 {
        return Err(GsplatError::Empty);
    }
    let three = |name: &str| layers.values(name, &[n, 3]);
    let (means, log_scales) = (three("means")?, three("scales")?);
    let quats = layers.values("quats", &[n, 4])?;
    let opacity_logits = column(layers, "opacities", n)?;
    let dc = layers.values("sh0", &[n, 1, 3])?;
    let rest = layers.need("shN")?;
    let &[rows, higher, 3] = rest.shape() else {
        return Err(GsplatError::Harmonics { shape: rest.shape().to_vec(), rows: n });
    };
    let sh_degree = sh::degree_of(higher + 1)
        .filter(|_| rows == n)
        .ok_or_else(|| GsplatError::Harmonics { shape: rest.shape().to_vec(), rows: n })?;
    let rest = rest.to_f32s();
    let mut coefficients = Vec::with_capacity(n * (higher + 1));
    for row in 0..n {
        coefficients.push([dc[3 * row], dc[3 * row + 1], dc[3 * row + 2]]);
        let own = &rest[3 * higher * row..3 * higher * (row + 1)];
        coefficients.extend_from_slice(own.as_chunks::<3>().0);
    }
    Ok(Splats {
        means: means.as_chunks::<3>().0.to_vec(),
        quats: quats.as_chunks::<4>().0.to_vec(),
        log_scales: log_scales.as_chunks::<3>().0.to_vec(),
        opacity_logits,
        sh: coefficients,
        sh_degree,
    })
}
