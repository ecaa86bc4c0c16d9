//! Rendered optical flow (Eqs. 11–12).

use crate::CuarError;
use gs_core::{Camera, Image, Rasterizer, RenderParams, Splats, projected_axes};
use rayon::prelude::*;

/// Composited displacement of the surfaces visible at each pixel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Flow {
    /// `Σ f α T`, pixels, x right and y down, `[H,W,2]`. As in the paper, **not** divided by
    /// coverage, so it decreases towards 0 where splats cover a pixel only in part.
    pub flow: Image,
    /// `Σ α T = 1 − T_final`, `[H,W,1]`.
    pub coverage: Image,
}

impl Flow {
    /// Flow divided by coverage, pixels, `[H,W,2]`; NaN where the coverage is below `min_coverage`
    /// (or zero).
    pub fn normalized(&self, min_coverage: f32) -> Image {
        let mut out = self.flow.clone();
        for (flow, &alpha) in out.data.chunks_exact_mut(2).zip(&self.coverage.data) {
            let known = alpha >= min_coverage && alpha > 0.0;
            for value in flow {
                *value = if known { *value / alpha } else { f32::NAN };
            }
        }
        out
    }
}

/// Eq. 11: `Proj(to.means) − Proj(from.means)` in pixels, `[N,2]`; `[0,0]` for splats that are not
/// in front of the camera (at or before its near plane, or not finite) in both.
///
/// # Errors
/// If the camera is invalid, or the numbers of splats differ.
pub fn displacements(
    from: &Splats,
    to: &Splats,
    camera: &Camera,
) -> Result<Vec<[f32; 2]>, CuarError> {
    camera.check()?;
    CuarError::check("to", to.len(), from.len())?;
    Ok(from
        .means
        .par_iter()
        .zip(&to.means)
        .with_min_len(1024)
        .map(|(&a, &b)| displacement(camera, a, b).map_or([0.0; 2], |moved| moved.by))
        .collect())
}

/// Motion of one splat on the image plane.
struct Displacement {
    /// Displacement, pixels.
    by: [f32; 2],
}

fn displacement(camera: &Camera, from: [f32; 3], to: [f32; 3]) -> Option<Displacement> {
    let (from, depth_from) = project(camera, from)?;
    let (to, depth_to) = project(camera, to)?;
    if depth_from.min(depth_to) <= camera.near {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, reason = "features are single precision")]
    let moved = Displacement { by: [(to[0] - from[0]) as f32, (to[1] - from[1]) as f32] };
    moved.by.iter().all(|value| value.is_finite()).then_some(moved)
}

/// Position, at a different time, of the point of a splat that is visible at pixel `p`:
/// `p ↦ shift + linear·p`, pixels.
pub(crate) struct AffineMotion {
    pub shift: [f32; 2],
    pub linear: [f32; 4],
    /// The splat's centre at that time, camera frame, world units.
    pub place: [f32; 3],
}

/// Regularises [`AffineMotion::linear`] towards the identity for splats thinner than this, pixels².
const AFFINE_EPS: f64 = 0.1;

/// Motion of row `i` from `from` to `to`, to first order in the distance from its centre: the axes
/// of the splat rotate and stretch. The point of the splat at a pixel is the expected one under the
/// Gaussian. With `K = J·R·S` (2×3, axes in pixels), the linear part is therefore
/// `K_to K_fromᵀ (K_from K_fromᵀ)⁻¹`. Displacements of centres alone (Eq. 11) have an error of the
/// rotation times the splat's size.
pub(crate) fn affine_motion(
    camera: &Camera,
    from: &Splats,
    to: &Splats,
    i: usize,
) -> Option<AffineMotion> {
    let (at, depth_from) = project(camera, from.means[i])?;
    let place = camera.to_camera(to.means[i].map(f64::from));
    let (there, depth) = project(camera, to.means[i])?;
    if depth_from.min(depth) <= camera.near {
        return None;
    }
    let a = projected_axes(from, i, camera);
    let b = projected_axes(to, i, camera);
    let dot = |x: [f64; 3], y: [f64; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    let cross = [
        dot(b[0], a[0]) + AFFINE_EPS,
        dot(b[0], a[1]),
        dot(b[1], a[0]),
        dot(b[1], a[1]) + AFFINE_EPS,
    ];
    let (p, q, r) = (dot(a[0], a[0]) + AFFINE_EPS, dot(a[0], a[1]), dot(a[1], a[1]) + AFFINE_EPS);
    let det = p * r - q * q;
    let linear = [
        (cross[0] * r - cross[1] * q) / det,
        (cross[1] * p - cross[0] * q) / det,
        (cross[2] * r - cross[3] * q) / det,
        (cross[3] * p - cross[2] * q) / det,
    ];
    let shift = [
        there[0] - linear[0] * at[0] - linear[1] * at[1],
        there[1] - linear[2] * at[0] - linear[3] * at[1],
    ];
    #[expect(clippy::cast_possible_truncation, reason = "features are single precision")]
    let motion = AffineMotion {
        shift: shift.map(|x| x as f32),
        linear: linear.map(|x| x as f32),
        place: place.map(|x| x as f32),
    };
    let finite = motion
        .shift
        .iter()
        .chain(&motion.linear)
        .chain(&motion.place)
        .all(|value| value.is_finite());
    finite.then_some(motion)
}

/// Position, pixels, and camera depth, world units.
fn project(camera: &Camera, mean: [f32; 3]) -> Option<([f64; 2], f64)> {
    let [x, y, z] = camera.to_camera(mean.map(f64::from));
    let k = &camera.intrinsics;
    (z > 0.0).then(|| ([k.fx * x / z + k.cx, k.fy * y / z + k.cy], z))
}

/// Eq. 12: the displacement `from → to`, composited with the geometry of `on`, the frame at whose
/// pixels the flow is defined.
///
/// The paper's `F_{1→t}` on frame 1 is `render_flow(r, s1, s1, st, camera)`; the flow that samples
/// frame 1 at the pixels of frame `t`, without holes, is `render_flow(r, st, st, s1, camera)`.
///
/// # Errors
/// If shapes differ, the camera is invalid, or the rasteriser fails.
pub fn render_flow<R: Rasterizer>(
    raster: &R,
    on: &Splats,
    from: &Splats,
    to: &Splats,
    camera: &Camera,
) -> Result<Flow, CuarError> {
    CuarError::check("from", from.len(), on.len())?;
    let features = displacements(from, to, camera)?.concat();
    let mut prepared = raster.prepare(on, camera)?;
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    let output = raster.forward(&mut prepared, on, &features, &params)?;
    Ok(Flow { flow: output.features_image(), coverage: output.alpha_image() })
}

/// Eq. 12 at the pixels of frame 1 towards `to`, and the camera depth at `to`: `Σ (f, z) α T`,
/// `[H,W,3]`, and coverage, `[H,W]`.
pub(crate) fn render_landing<R: Rasterizer>(
    raster: &R,
    first: &Splats,
    to: &Splats,
    camera: &Camera,
) -> Result<(Vec<f32>, Vec<f32>), CuarError> {
    let moved = displacements(first, to, camera)?;
    let mut features = Vec::with_capacity(moved.len() * 3);
    for (by, &mean) in moved.iter().zip(&to.means) {
        #[expect(clippy::cast_possible_truncation, reason = "features are single precision")]
        let depth = camera.to_camera(mean.map(f64::from))[2] as f32;
        features.extend([by[0], by[1], if depth.is_finite() { depth } else { 0.0 }]);
    }
    let mut prepared = raster.prepare(first, camera)?;
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    let output = raster.forward(&mut prepared, first, &features, &params)?;
    Ok((output.features, output.alpha))
}
