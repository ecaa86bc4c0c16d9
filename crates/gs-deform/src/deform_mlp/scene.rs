//! [`MlpScene`]: canonical splats deformed by a network.

use super::network::DeformMlp;
use super::screw;
use crate::FieldError;
use crate::shape::RasterizedShapes;
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, quat};
use rayon::prelude::*;

/// Canonical splats and the network that deforms them: a model of
/// Deformable-3D-Gaussians, at times 0 to 1.
///
/// With the network's outputs `d` at a splat's canonical centre, the centre is `x + dₓ` (or a screw
/// motion of `x`), the rotation `normalise(q) + d_q`, the scale `exp(s) + d_s`. The quaternion is
/// not normalised again, so it is not a rotation; the returned splats have the covariance that the
/// reference's rasteriser computes from it. Opacity and colour are constant.
#[derive(Debug)]
pub struct MlpScene {
    canonical: Splats,
    mlp: DeformMlp,
}

impl MlpScene {
    /// A scene from its parts.
    ///
    /// # Errors
    /// If the arrays of `canonical` disagree.
    pub fn new(canonical: Splats, mlp: DeformMlp) -> Result<Self, FieldError> {
        canonical.check_shapes()?;
        Ok(Self { canonical, mlp })
    }

    /// The stored splats, before any deformation.
    pub fn canonical(&self) -> &Splats {
        &self.canonical
    }

    /// The network.
    pub fn mlp(&self) -> &DeformMlp {
        &self.mlp
    }

    /// Input of the reference's rasteriser at time `t`.
    pub fn rasterized(&self, t: f32) -> RasterizedShapes {
        let outputs = self.mlp.outputs(&self.canonical.means, t);
        let is_screw = self.mlp.is_screw();
        let means = self.canonical.means.par_iter().zip(&outputs.warp).map(|(&x, &warp)| {
            if is_screw {
                screw::moved(x, warp)
            } else {
                [x[0] + warp[0], x[1] + warp[1], x[2] + warp[2]]
            }
        });
        let quats = self.canonical.quats.par_iter().zip(&outputs.rotation).map(|(&q, change)| {
            let unit = quat::normalize(q);
            std::array::from_fn(|k| unit[k] + change[k])
        });
        let scales = self.canonical.log_scales.par_iter().zip(&outputs.scaling);
        let scales = scales
            .map(|(log_scale, change)| std::array::from_fn(|k| log_scale[k].exp() + change[k]));
        RasterizedShapes {
            means: means.collect(),
            quats: quats.collect(),
            scales: scales.collect(),
        }
    }
}

impl DynamicScene for MlpScene {
    fn num_splats(&self) -> usize {
        self.canonical.len()
    }

    fn sh_degree(&self) -> usize {
        self.canonical.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.geometry_into(t, out)?;
        out.opacity_logits.clone_from(&self.canonical.opacity_logits);
        out.sh.clone_from(&self.canonical.sh);
        out.sh_degree = self.canonical.sh_degree;
        Ok(())
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        let range = self.time_range();
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        self.rasterized(t).into_splats(out);
        Ok(())
    }

    fn fades(&self) -> bool {
        false
    }
}
