//! Builds one grid from the tensors of a file.

use super::Grid4dError;
use crate::pth::Layers;
use gs_deform::{SmoothGrid, SmoothGridParts};

/// The grid `name` over these of the coordinates x, y, z, t.
pub(super) fn grid(
    layers: &Layers<'_>,
    name: &str,
    axes: &[usize],
) -> Result<SmoothGrid, Grid4dError> {
    let part = |part: &str| format!("0.{name}_encoding.{part}");
    let embeddings = layers.need(&part("embeddings"))?;
    let &[_, channels] = embeddings.shape() else {
        return Err(Grid4dError::Embeddings {
            name: part("embeddings"),
            shape: embeddings.shape().to_vec(),
        });
    };
    let offsets = layers.need(&part("offsets"))?.to_f64s().into_iter().map(|value| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "integers; invalid offsets are detected by the grid"
        )]
        let offset = value.max(0.0) as usize;
        offset
    });
    Ok(SmoothGrid::new(
        &format!("{name}_encoding"),
        SmoothGridParts {
            axes: axes.to_vec(),
            per_level_scale: layers.values(&part("per_level_scale"), &[axes.len()])?,
            base_resolution: layers.values(&part("base_resolution"), &[axes.len()])?,
            offsets: offsets.collect(),
            embeddings: embeddings.to_f32s(),
            channels,
        },
    )?)
}
