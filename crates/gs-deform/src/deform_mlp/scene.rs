//! [`MlpScene`]: canonical splats deformed by a network.

use super::network::DeformMlp;
use super::screw;
use crate::FieldError;
use crate::geometry_scene::{GeometryField, GeometryScene};
use crate::shape::RasterizedShapes;
use gs_core::{Splats, quat};
use rayon::prelude::*;

/// Canonical splats and the network that deforms them: a model of Deformable-3D-Gaussians.
///
/// With the network's outputs `d` at a splat's canonical centre, the centre is `x + dₓ` (or a screw
/// motion of `x`), the rotation `normalise(q) + d_q`, which is not normalised again, the scale
/// `exp(s) + d_s`.
pub type MlpScene = GeometryScene<DeformMlp>;

impl MlpScene {
    /// A scene from its parts.
    ///
    /// # Errors
    /// If the arrays of `canonical` have inconsistent lengths.
    pub fn new(canonical: Splats, mlp: DeformMlp) -> Result<Self, FieldError> {
        Self::of(canonical, mlp)
    }
}

impl GeometryField for DeformMlp {
    fn rasterized(&self, canonical: &Splats, t: f32) -> RasterizedShapes {
        let outputs = self.outputs(&canonical.means, t);
        let is_screw = self.is_screw();
        let means = canonical.means.par_iter().zip(&outputs.warp).map(|(&x, &warp)| {
            if is_screw {
                screw::moved(x, warp)
            } else {
                [x[0] + warp[0], x[1] + warp[1], x[2] + warp[2]]
            }
        });
        let quats = canonical.quats.par_iter().zip(&outputs.rotation).map(|(&q, change)| {
            let unit = quat::normalize(q);
            std::array::from_fn(|k| unit[k] + change[k])
        });
        let scales = canonical.log_scales.par_iter().zip(&outputs.scaling);
        let scales = scales
            .map(|(log_scale, change)| std::array::from_fn(|k| log_scale[k].exp() + change[k]));
        RasterizedShapes {
            means: means.collect(),
            quats: quats.collect(),
            scales: scales.collect(),
        }
    }
}
