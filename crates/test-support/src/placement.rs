//! Checks that an image does not depend on a scene's size and position if its camera is transformed
//! alike, for every implementation of [`gs_core::Rasterizer`].

#![allow(clippy::unwrap_used, reason = "a check that cannot go on has failed")]
#![allow(clippy::cast_possible_truncation, reason = "the checks are about single precision")]

use crate::compare::{relative_l2, show_errors, widen};
use gs_core::image_formation::NEAR_PLANE;
use gs_core::{Camera, Rasterizer, RenderParams, Splats};

/// Smallest PSNR against the original after scaling, dB. Worst seen 100.6 dB.
const SCALED_DB: f64 = 92.0;

/// The scene and its camera, scaled about the origin and then moved by `shift`.
pub fn placed(splats: &Splats, camera: &Camera, scale: f64, shift: [f64; 3]) -> (Splats, Camera) {
    let (mut splats, mut camera) = (splats.clone(), camera.clone());
    for mean in &mut splats.means {
        *mean = [0, 1, 2].map(|k| (scale * f64::from(mean[k]) + shift[k]) as f32);
    }
    for log_scale in splats.log_scales.as_flattened_mut() {
        *log_scale += scale.ln() as f32;
    }
    for row in &mut camera.viewmat[..3] {
        row[3] = scale * row[3] - (0..3).map(|k| row[k] * shift[k]).sum::<f64>();
    }
    camera.near *= scale;
    (splats, camera)
}

fn render<R: Rasterizer>(raster: &R, splats: &Splats, camera: &Camera) -> Vec<f32> {
    let params = RenderParams { background: [0.1, 0.2, 0.3], ..RenderParams::default() };
    let mut prepared = raster.prepare(splats, camera).unwrap();
    raster.forward(&mut prepared, splats, &[], &params).unwrap().rgb
}

fn psnr(a: &[f32], b: &[f32]) -> f64 {
    let square = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    -10.0 * (square / a.len() as f64).log10()
}

/// Scales the scene by 1e-6 to 1e6, and moves it by a thousand scene sizes, where stored positions
/// are rounded to 6e-5 of the scene; images may then differ by `shifted_db`.
///
/// # Panics
/// If the images differ by more, or the scene is invisible.
pub fn check_placement<R: Rasterizer>(
    raster: &R,
    (splats, camera): (&Splats, &Camera),
    shifted_db: f64,
) {
    let what = "placement";
    let here = render(raster, splats, camera);
    assert!(here.iter().any(|value| *value > 0.5), "the scene is visible");
    for scale in [1e-6, 1e-3, 1e-2, 1e2, 1e3, 1e6] {
        let (splats, camera) = placed(splats, camera, scale, [0.0; 3]);
        let there = psnr(&render(raster, &splats, &camera), &here);
        show_errors(what, format_args!("scaled by {scale}: {there:.1} dB"));
        assert!(there > SCALED_DB, "scaled by {scale}: {there:.1} dB");
    }
    for shift in [[2000.0, 0.0, 0.0], [-1200.0, 900.0, 1300.0]] {
        let (splats, camera) = placed(splats, camera, 1.0, shift);
        let there = psnr(&render(raster, &splats, &camera), &here);
        show_errors(what, format_args!("moved by {shift:?}: {there:.1} dB"));
        assert!(there > shifted_db, "moved by {shift:?}: {there:.1} dB");
    }
}

/// The negative control of [`check_placement`]: the near plane of training, fixed in world units,
/// culls a scene scaled to a hundredth. A near plane at the median depth culls exactly the splats
/// before it.
///
/// # Panics
/// If other splats are drawn.
pub fn check_near_plane<R: Rasterizer>(raster: &R, (splats, camera): (&Splats, &Camera)) {
    let (small, near) = placed(splats, camera, 0.01, [0.0; 3]);
    let near = near.with_near(NEAR_PLANE);
    let background = render(raster, &Splats::default(), &near);
    assert_eq!(render(raster, &small, &near), background, "everything is before the near plane");
    let depths: Vec<f64> =
        splats.means.iter().map(|mean| camera.to_camera(mean.map(f64::from))[2]).collect();
    let mut sorted = depths.clone();
    sorted.sort_by(f64::total_cmp);
    // Between two splats, so that rounding has no effect.
    let half = sorted.len() / 2;
    let plane = f64::midpoint(sorted[half - 1], sorted[half]);
    let middle = camera.clone().with_near(plane);
    let behind: Vec<usize> = (0..splats.len()).filter(|&i| depths[i] > plane).collect();
    let seen = render(raster, splats, &middle);
    let kept = render(raster, &splats.select(&behind), &middle);
    let error = relative_l2(&widen(&seen), &widen(&kept));
    assert!(error < 1e-6, "the other splats are unchanged: {error:e}");
}
