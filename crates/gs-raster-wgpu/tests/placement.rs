//! The image does not depend on a scene's size and position if its camera is transformed alike.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![allow(clippy::cast_possible_truncation, reason = "the test is about single precision")]

mod common;

use common::{Mode, camera, cloud, raster};
use gs_core::image_formation::NEAR_PLANE;
use gs_core::{Camera, Rasterizer, RenderParams, Splats};

/// Smallest PSNR against the original after scaling, dB.
const SCALED_DB: f64 = 90.0;
/// Smallest PSNR at a thousand scene sizes from the origin, where stored
/// positions are rounded to 6e-5 of the scene, dB.
const SHIFTED_DB: f64 = 65.0;

fn placed(splats: &Splats, camera: &Camera, scale: f64, shift: [f64; 3]) -> (Splats, Camera) {
    let (mut splats, mut camera) = (splats.clone(), camera.clone());
    for mean in &mut splats.means {
        *mean = [0, 1, 2].map(|k| (scale * f64::from(mean[k]) + shift[k]) as f32);
    }
    for log_scale in splats.log_scales.as_flattened_mut() {
        *log_scale += (scale as f32).ln();
    }
    for row in &mut camera.viewmat[..3] {
        row[3] = scale * row[3] - (0..3).map(|k| row[k] * shift[k]).sum::<f64>();
    }
    camera.near *= scale;
    (splats, camera)
}

fn render(splats: &Splats, camera: &Camera) -> Vec<f32> {
    let raster = raster(Mode::Portable);
    let params = RenderParams { background: [0.1, 0.2, 0.3], ..RenderParams::default() };
    let mut prepared = raster.prepare(splats, camera).unwrap();
    raster.forward(&mut prepared, splats, &[], &params).unwrap().rgb
}

fn psnr(a: &[f32], b: &[f32]) -> f64 {
    let square = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    -10.0 * (square / a.len() as f64).log10()
}

#[test]
fn scaling_and_translation_do_not_change_the_image() {
    let (splats, camera) = (cloud(11, 800, 2, -3.0), camera(160, 120));
    let here = render(&splats, &camera);
    assert!(here.iter().any(|value| *value > 0.5), "the scene is visible");
    for scale in [1e-6, 1e-3, 1e-2, 1e2, 1e3, 1e6] {
        let (splats, camera) = placed(&splats, &camera, scale, [0.0; 3]);
        let there = psnr(&render(&splats, &camera), &here);
        assert!(there > SCALED_DB, "{scale} times as large: {there:.1} dB");
    }
    for shift in [[2000.0, 0.0, 0.0], [-1200.0, 900.0, 1300.0]] {
        let (splats, camera) = placed(&splats, &camera, 1.0, shift);
        let there = psnr(&render(&splats, &camera), &here);
        assert!(there > SHIFTED_DB, "moved by {shift:?}: {there:.1} dB");
    }
    // Negative control: the reference's near plane culls a scene scaled to a hundredth.
    let (splats, camera) = placed(&splats, &camera, 0.01, [0.0; 3]);
    let cut = render(&splats, &camera.with_near(NEAR_PLANE));
    assert!(psnr(&cut, &here) < 30.0, "nothing is left");
}
