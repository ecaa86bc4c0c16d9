//! Colour uncertainty and artifact mask (Eqs. 14–17).

use crate::CuarError;
use gs_core::{Camera, Image, Rasterizer, RenderParams, Splats, sh};
use rayon::prelude::*;

/// Unit vector from `eye` to `mean`, world frame, and whether it is finite.
pub(crate) fn direction(eye: [f32; 3], mean: [f32; 3]) -> Option<[f32; 3]> {
    let d = [0, 1, 2].map(|axis| mean[axis] - eye[axis]);
    let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    let unit = d.map(|x| x / length);
    unit.iter().all(|x| x.is_finite()).then_some(unit)
}

/// Camera centre in single precision, as in the rasteriser.
#[expect(clippy::cast_possible_truncation, reason = "directions are single precision")]
pub(crate) fn eye(camera: &Camera) -> [f32; 3] {
    camera.position().map(|x| x as f32)
}

/// `max(0, 0.5 + Σ Y sh)` of row `i` towards `eye`.
pub(crate) fn shown(splats: &Splats, i: usize, eye: [f32; 3]) -> Option<[f32; 3]> {
    let towards = direction(eye, splats.means[i])?;
    Some(sh::color(splats.sh_degree, splats.sh_of(i), towards).map(|x| x.max(0.0)))
}

/// [`shown`] of every row from `camera`, `[N]`.
pub(crate) fn shown_colors(splats: &Splats, camera: &Camera) -> Vec<Option<[f32; 3]>> {
    let eye = eye(camera);
    (0..splats.len()).into_par_iter().with_min_len(1024).map(|i| shown(splats, i, eye)).collect()
}

/// Eqs. 14–15 of two colours; 0 if one is not finite (the rasteriser culls such splats).
pub(crate) fn change(now: [f32; 3], then: [f32; 3]) -> f32 {
    let difference: f32 = (0..3).map(|channel| (now[channel] - then[channel]).abs()).sum();
    if difference.is_finite() { 1.0 - (-difference).exp() } else { 0.0 }
}

/// Eqs. 14–15 for one row.
fn xi(at_t: &Splats, at_1: &Splats, i: usize, eye: [f32; 3]) -> f32 {
    let (Some(t), Some(one)) = (shown(at_t, i, eye), shown(at_1, i, eye)) else { return 0.0 };
    change(t, one)
}

/// Eqs. 14–15: `ξ = 1 − exp(−‖c_t − c_1‖₁)` per splat, `[N]` in [0,1): the change of its displayed
/// colour towards `camera` between the two times. Colours are those of the rasteriser (clamped at
/// 0), each with the view direction of its own time.
///
/// # Errors
/// If the arrays have inconsistent lengths or the camera is malformed.
pub fn color_uncertainty(
    at_t: &Splats,
    at_1: &Splats,
    camera: &Camera,
) -> Result<Vec<f32>, CuarError> {
    camera.check()?;
    at_t.check_shapes()?;
    at_1.check_shapes()?;
    CuarError::check("at_1", at_1.len(), at_t.len())?;
    let eye = eye(camera);
    Ok((0..at_t.len()).into_par_iter().with_min_len(1024).map(|i| xi(at_t, at_1, i, eye)).collect())
}

/// Eq. 16: `U = Σ ξ α T` with the geometry of `at_t`, `[H,W,1]`.
///
/// # Errors
/// As [`color_uncertainty`], or if the rasteriser fails.
pub fn render_uncertainty<R: Rasterizer>(
    raster: &R,
    at_t: &Splats,
    at_1: &Splats,
    camera: &Camera,
) -> Result<Image, CuarError> {
    let features = color_uncertainty(at_t, at_1, camera)?;
    composite(raster, at_t, &features, camera)
}

/// Eq. 16 of ξ̂ = 1 − (1 − ξ)(1 − ξ′), where ξ′ `[N]` is that of [`crate::Evidence`]: uncertainty
/// from view dependence and from missing supervision, `[H,W,1]`.
///
/// # Errors
/// As [`render_uncertainty`], and if the length of `evidence` differs.
pub fn render_total_uncertainty<R: Rasterizer>(
    raster: &R,
    at_t: &Splats,
    at_1: &Splats,
    evidence: &[f32],
    camera: &Camera,
) -> Result<Image, CuarError> {
    CuarError::check("evidence", evidence.len(), at_t.len())?;
    let mut features = color_uncertainty(at_t, at_1, camera)?;
    for (xi, evidence) in features.iter_mut().zip(evidence) {
        *xi = 1.0 - (1.0 - *xi) * (1.0 - evidence);
    }
    composite(raster, at_t, &features, camera)
}

/// Eq. 16 of ξ′ alone, `[N]` or empty for zeros: `[H,W,1]`.
///
/// # Errors
/// As [`render_total_uncertainty`].
pub fn render_evidence<R: Rasterizer>(
    raster: &R,
    at_t: &Splats,
    evidence: &[f32],
    camera: &Camera,
) -> Result<Image, CuarError> {
    if evidence.is_empty() {
        return composite(raster, at_t, &vec![0.0; at_t.len()], camera);
    }
    CuarError::check("evidence", evidence.len(), at_t.len())?;
    composite(raster, at_t, evidence, camera)
}

/// `Σ f α T` of one feature per splat.
fn composite<R: Rasterizer>(
    raster: &R,
    at_t: &Splats,
    features: &[f32],
    camera: &Camera,
) -> Result<Image, CuarError> {
    let mut prepared = raster.prepare(at_t, camera)?;
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    Ok(raster.forward(&mut prepared, at_t, features, &params)?.features_image())
}

/// Right-hand side of Eq. 17: `max(ε·mean(U), floor)`.
pub(crate) fn threshold(uncertainty: &[f32], epsilon: f32, floor: f32) -> f64 {
    let sum: f64 = uncertainty.iter().map(|&u| f64::from(u)).sum();
    let mean = sum / uncertainty.len().max(1) as f64;
    (f64::from(epsilon) * mean).max(f64::from(floor))
}

/// Eq. 17: `U > max(ε·mean(U), floor)`, 0 or 1, `[H,W,1]`. The paper has no floor (0). With a
/// floor, invisible differences are not artifacts even if the whole image is certain.
pub fn artifact_mask(uncertainty: &Image, epsilon: f32, floor: f32) -> Image {
    let threshold = threshold(&uncertainty.data, epsilon, floor);
    let flag = |&u: &f32| f32::from(u8::from(f64::from(u) > threshold));
    Image { data: uncertainty.data.iter().map(flag).collect(), ..*uncertainty }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mask_is_relative_to_the_mean() {
        let map = Image::from_data(4, 1, 1, vec![0.0, 0.1, 0.3, 0.8]).unwrap(); // mean 0.3
        assert_eq!(artifact_mask(&map, 0.5, 0.0).data, [0.0, 0.0, 1.0, 1.0], "ε = 0.5");
        assert_eq!(artifact_mask(&map, 2.0, 0.0).data, [0.0, 0.0, 0.0, 1.0], "ε = 2");
        assert_eq!(artifact_mask(&map, 0.5, 0.9).data, [0.0; 4], "floor");
        assert_eq!(artifact_mask(&Image::zeros(4, 1, 1), 0.5, 0.0).data, [0.0; 4], "certain");
    }

    #[test]
    fn xi_of_a_known_colour_change() {
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 1.0, 8, 8);
        let splats = |mean: [f32; 3]| Splats {
            means: vec![mean],
            quats: vec![[1.0, 0.0, 0.0, 0.0]],
            log_scales: vec![[0.0; 3]],
            opacity_logits: vec![0.0],
            // only the z term of degree 1, red
            sh: vec![[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [0.0; 3]],
            sh_degree: 1,
        };
        let xi = color_uncertainty(&splats([3.0, 0.0, 4.0]), &splats([0.0, 0.0, 2.0]), &camera);
        let expected = 1.0 - (-0.488_602_5_f32 * (1.0 - 0.8)).exp();
        assert!((xi.unwrap()[0] - expected).abs() < 1e-6, "cosine falls from 1 to 0.8");
    }
}
