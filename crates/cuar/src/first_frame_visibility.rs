//! How visible each splat is in frame 1.
//!
//! Where broad splats overlap, the composited depth is not a surface, and no colour can be fetched from frame 1. But a splat that is visible
//! in frame 1 has a known colour. A pixel that is composited from such splats has a known colour, too, without resampling.

use crate::{CuarError, flow::axes};
use gs_core::image_formation::{ALPHA_THRESHOLD, EPS2D};
use gs_core::{Camera, Rasterizer, RenderGrads, RenderParams, Splats, UpstreamGrads};
use rayon::prelude::*;

/// `Σ_p α T` per splat over the image of the last forward pass of `prepared` (which had one feature per splat), `[N]`.
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

/// Visibility of each splat in frame 1, `[N]` in [0, 1]: its weight in frame 1 (`weights`), relative to `enough` of its unoccluded weight now.
pub(crate) fn visibility(
    splats: &Splats,
    weights: &[f32],
    camera: &Camera,
    enough: f32,
) -> Vec<f32> {
    weights
        .par_iter()
        .enumerate()
        .with_min_len(1024)
        .map(|(i, &weight)| {
            let whole = f64::from(enough) * unoccluded(splats, i, camera);
            #[expect(clippy::cast_possible_truncation, reason = "a share of 0 to 1")]
            let shown = (f64::from(weight) / whole).min(1.0) as f32;
            if shown.is_finite() { shown } else { 0.0 }
        })
        .collect()
}

/// `Σ_p α` of a splat that lies within the image: the volume of its Gaussian above the faintest alpha drawn.
fn unoccluded(splats: &Splats, i: usize, camera: &Camera) -> f64 {
    let [u, v] = axes(camera, splats, i);
    let dot = |x: [f64; 3], y: [f64; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    let blur = f64::from(EPS2D);
    let det = (dot(u, u) + blur) * (dot(v, v) + blur) - dot(u, v).powi(2);
    let above = (f64::from(splats.opacity(i)) - f64::from(ALPHA_THRESHOLD)).max(0.0);
    std::f64::consts::TAU * det.max(0.0).sqrt() * above
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::sh;
    use gs_raster_cpu::CpuRasterizer;

    /// A red splat, a green one a little behind it, and one far aside.
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
    fn an_unoccluded_splat_is_shown_whole_and_one_behind_it_in_part() {
        let splats = three();
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.9, 160, 120);
        let raster = CpuRasterizer::default();
        let mut prepared = raster.prepare(&splats, &camera).unwrap();
        let params = RenderParams::default();
        raster.forward(&mut prepared, &splats, &[0.0; 3], &params).unwrap();
        let weights = splat_weights(&raster, &mut prepared, &splats, &params, 160 * 120).unwrap();
        let shown = visibility(&splats, &weights, &camera, 1.0);
        // the tails beyond 3σ and whole pixels: 2 %
        assert!((shown[0] - 1.0).abs() < 0.02 && (shown[2] - 1.0).abs() < 0.02, "{shown:?}");
        assert!((0.2..0.8).contains(&shown[1]), "behind the first: {shown:?}");
    }

    #[test]
    fn what_was_faint_in_frame_1_is_not_shown_by_it() {
        let mut splats = three();
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 0.9, 160, 120);
        splats.opacity_logits[2] = 5.0;
        // frame 1 had it at a hundredth of its weight
        let share = 0.01 * unoccluded(&splats, 2, &camera);
        #[expect(clippy::cast_possible_truncation, reason = "a test's number")]
        let shown = visibility(&splats, &[0.0, 0.0, share as f32], &camera, 0.1);
        assert_eq!(shown[..2], [0.0; 2], "not seen");
        assert!((shown[2] - 0.1).abs() < 1e-4, "{shown:?}");
    }
}
