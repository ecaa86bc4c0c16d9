//! Builds the network from named tensors.

use super::Deformable3dgsError;
use crate::pth::Layers;
use gs_deform::{DeformMlp, DeformMlpParts, Warp};

/// The network whose names begin with `prefix`.
pub(crate) fn network(layers: &Layers<'_>, prefix: &str) -> Result<DeformMlp, Deformable3dgsError> {
    let name = |rest: &str| format!("{prefix}{rest}");
    if let Some(grid) = layers.names().find(|name| is_grid(name)) {
        return Err(Deformable3dgsError::HashGrid { name: grid.to_owned() });
    }
    if !layers.has(&name("linear.0.weight")) {
        return Err(Deformable3dgsError::OtherNetwork {
            missing: name("linear.0.weight"),
            found: layers.summary(),
        });
    }
    let timenet = match layers.linear_if_there(&name("timenet.0"))? {
        Some(hidden) => Some([hidden, layers.linear(&name("timenet.2"))?]),
        None => None,
    };
    let warp = match layers.linear_if_there(&name("branch_w"))? {
        Some(rotation) => Warp::Screw { rotation, translation: layers.linear(&name("branch_v"))? },
        None => Warp::Translation(layers.linear(&name("gaussian_warp"))?),
    };
    let color = if let Some(only) = layers.linear_if_there(&name("gaussian_color"))? {
        Some(vec![only])
    } else {
        let several = layers.sequence(|index| name(&format!("gaussian_color.{}", 2 * index)))?;
        Some(several).filter(|several| !several.is_empty())
    };
    Ok(DeformMlp::new(DeformMlpParts {
        timenet,
        layers: layers.sequence(|index| name(&format!("linear.{index}")))?,
        warp,
        rotation: layers.linear(&name("gaussian_rotation"))?,
        scaling: layers.linear(&name("gaussian_scaling"))?,
        opacity: layers.linear_if_there(&name("gaussian_opacity"))?,
        color,
        local_rotation: layers.linear_if_there(&name("local_rotation"))?,
    })?)
}

/// Whether a name is that of a hash grid of tiny-cuda-nn or similar libraries.
fn is_grid(name: &str) -> bool {
    name.ends_with(".params") || name.ends_with("embeddings") || name.contains("hash")
}
