//! How visible each splat is in frame 1.
//!
//! Where broad splats overlap, the composited depth is not a surface, so no colour can be sampled
//! from frame 1. But the colour of a splat that is visible in frame 1 is known. So is the colour of
//! a pixel composited from such splats, without resampling.

use crate::CuarError;
use gs_core::{
    Camera, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads,
    visible_share,
};
use rayon::prelude::*;

/// `Σ_p α T` per splat over the image of the last forward pass of `prepared` (which had one feature
/// per splat), `[N]`.
pub(crate) fn splat_weights<R: Rasterizer>(
    raster: &R,
    prepared: &mut R::Prepared,
    splats: &Splats,
    params: &RenderParams,
    pixels: usize,
) -> Result<Vec<f32>, CuarError> {
    let upstream = UpstreamGrads { v_features: vec![1.0; pixels], ..UpstreamGrads::default() };
    let mut grads = RenderGrads::default();
    let features = vec![0.0; splats.len()];
    raster.backward_colors_into(prepared, splats, &features, params, &upstream, &mut grads)?;
    Ok(grads.v_features)
}

/// Visibility of each splat in frame 1, `[N]` in [0, 1]: its weight in frame 1 (`weights`),
/// relative to `enough` of its unoccluded weight now.
fn visibility(splats: &Splats, weights: &[f32], camera: &Camera, enough: f32) -> Vec<f32> {
    weights
        .par_iter()
        .enumerate()
        .with_min_len(1024)
        .map(|(i, &weight)| visible_share(splats, i, weight, camera, enough))
        .collect()
}

/// Visibility of each splat of frame 1, `[N]` in [0, 1]: the largest share of its unoccluded weight
/// `Σ_p α` that is visible from any of `cameras`, `max_v Σ_p α T / Σ_p α`. `splats` are those of
/// frame 1.
///
/// # Errors
/// If a camera is malformed, shapes differ, or the rasteriser fails.
pub fn first_frame_shares<R: Rasterizer>(
    raster: &R,
    splats: &Splats,
    cameras: &[Camera],
) -> Result<Vec<f32>, CuarError> {
    survey(raster, splats, cameras, &[]).map(|(shares, _)| shares)
}

/// As [`first_frame_shares`]; also returns which of the `places` (position and radius, world units)
/// `splats` hide from every camera.
pub(crate) fn survey<R: Rasterizer>(
    raster: &R,
    splats: &Splats,
    cameras: &[Camera],
    places: &[([f32; 3], f64)],
) -> Result<(Vec<f32>, Vec<bool>), CuarError> {
    let mut shares = vec![0.0_f32; splats.len()];
    let mut hidden = vec![true; places.len()];
    let params = RenderParams { rgb: false, depth: !places.is_empty(), ..RenderParams::default() };
    let (mut prepared, mut output) = (None, RenderOutput::default());
    let features = vec![0.0; splats.len()];
    for camera in cameras {
        let prepared = match &mut prepared {
            Some(prepared) => {
                raster.prepare_into(splats, camera, prepared)?;
                prepared
            }
            none => none.insert(raster.prepare(splats, camera)?),
        };
        raster.forward_into(prepared, splats, &features, &params, &mut output)?;
        let pixels = output.width * output.height;
        let weights = splat_weights(raster, prepared, splats, &params, pixels)?;
        let shown = visibility(splats, &weights, camera, 1.0);
        shares.iter_mut().zip(shown).for_each(|(share, shown)| *share = share.max(shown));
        for (hidden, place) in hidden.iter_mut().zip(places) {
            *hidden &= !is_in_front(&output, camera, *place);
        }
    }
    Ok((shares, hidden))
}

/// Coverage above which a pixel hides what lies behind it.
const COVERED: f32 = 0.9;

/// Whether `place` lies in view, and no surface of the render lies in front of it by more than its
/// radius.
fn is_in_front(output: &RenderOutput, camera: &Camera, (place, radius): ([f32; 3], f64)) -> bool {
    let place = place.map(f64::from);
    let Some([u, v]) = camera.project(place) else { return false };
    if !(u >= 0.0 && v >= 0.0 && u < output.width as f64 && v < output.height as f64) {
        return false;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "inside the image, checked above"
    )]
    let pixel = v as usize * output.width + u as usize;
    let alpha = output.alpha[pixel];
    let z = camera.to_camera(place)[2];
    alpha < COVERED || z - radius <= f64::from(output.depth[pixel] / alpha)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::{sh, unoccluded_weight};
    use gs_raster_cpu::CpuRasterizer;

    /// A red splat, a green one a little behind it, and one far to the side.
    fn three() -> Splats {
        let mut splats = Splats::with_capacity(3, 0);
        for (x, z) in [(0.0, 3.0), (0.0, 3.5), (0.8, 3.2)] {
            splats.means.push([x, 0.0, z]);
            splats.quats.push([0.9, 0.1, 0.3, -0.2]);
            splats.log_scales.push([-2.0, -2.3, -2.6]);
            splats.opacity_logits.push(1.0);
            splats.sh.push(sh::dc_from_rgb([0.5; 3]));
        }
        splats
    }

    #[test]
    fn unoccluded_splats_have_share_one_and_occluded_ones_less() {
        let splats = three();
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.9, 160, 120);
        let raster = CpuRasterizer::default();
        let mut prepared = raster.prepare(&splats, &camera).unwrap();
        let params = RenderParams::default();
        raster.forward(&mut prepared, &splats, &[0.0; 3], &params).unwrap();
        let weights = splat_weights(&raster, &mut prepared, &splats, &params, 160 * 120).unwrap();
        let shown = visibility(&splats, &weights, &camera, 1.0);
        // 2 % for the tails beyond 3σ and the rounding to whole pixels
        assert!((shown[0] - 1.0).abs() < 0.02 && (shown[2] - 1.0).abs() < 0.02, "{shown:?}");
        assert!((0.2..0.8).contains(&shown[1]), "partly occluded: {shown:?}");
    }

    #[test]
    fn splats_faint_in_frame_1_have_share_zero() {
        let mut splats = three();
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.9, 160, 120);
        splats.opacity_logits[2] = 5.0;
        // in frame 1 it had a hundredth of its weight
        let share = 0.01 * unoccluded_weight(&splats, 2, &camera);
        #[expect(clippy::cast_possible_truncation, reason = "a test's number")]
        let shown = visibility(&splats, &[0.0, 0.0, share as f32], &camera, 0.1);
        assert_eq!(shown[..2], [0.0; 2], "not visible");
        assert!((shown[2] - 0.1).abs() < 1e-4, "{shown:?}");
    }
}
