//! The image does not depend on a scene's size and position if its camera is transformed alike.

use crate::scenes;
use gs_core::{Camera, Rasterizer, RenderParams, Splats};
use gs_raster_cpu::CpuRasterizer;
use test_support::compare::{relative_l2, widen};

/// Smallest PSNR against the original after scaling, dB. Worst seen 100.6.
const SCALED_DB: f64 = 90.0;
/// Smallest PSNR at a thousand scene sizes from the origin, where stored positions are rounded to
/// 6e-5 of the scene, dB. Worst seen 91.3.
const SHIFTED_DB: f64 = 80.0;

#[expect(clippy::cast_possible_truncation, reason = "the test is about single precision")]
fn to_f32(value: f64) -> f32 {
    value as f32
}

fn placed(splats: &Splats, camera: &Camera, scale: f64, shift: [f64; 3]) -> (Splats, Camera) {
    let (mut splats, mut camera) = (splats.clone(), camera.clone());
    for mean in &mut splats.means {
        *mean = [0, 1, 2].map(|k| to_f32(scale * f64::from(mean[k]) + shift[k]));
    }
    for log_scale in splats.log_scales.as_flattened_mut() {
        *log_scale += to_f32(scale.ln());
    }
    for row in &mut camera.viewmat[..3] {
        row[3] = scale * row[3] - (0..3).map(|k| row[k] * shift[k]).sum::<f64>();
    }
    camera.near *= scale;
    (splats, camera)
}

fn render(splats: &Splats, camera: &Camera) -> Vec<f32> {
    let raster = CpuRasterizer::default();
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
    let scene = scenes::random::<f32>(800, 0, [160, 120], 5);
    let here = render(&scene.splats, &scene.camera);
    assert!(here.iter().any(|value| *value > 0.5), "the scene is visible");
    for scale in [1e-6, 1e-3, 1e-2, 1e2, 1e3, 1e6] {
        let (splats, camera) = placed(&scene.splats, &scene.camera, scale, [0.0; 3]);
        let there = psnr(&render(&splats, &camera), &here);
        assert!(there > SCALED_DB, "{scale} times as large: {there:.1} dB");
    }
    for shift in [[2000.0, 0.0, 0.0], [-1200.0, 900.0, 1300.0]] {
        let (splats, camera) = placed(&scene.splats, &scene.camera, 1.0, shift);
        let there = psnr(&render(&splats, &camera), &here);
        assert!(there > SHIFTED_DB, "moved by {shift:?}: {there:.1} dB");
    }
}

/// Negative control of the above, and a test of the near plane.
#[test]
fn the_cameras_near_plane_culls() {
    let scene = scenes::random::<f32>(800, 0, [160, 120], 5);
    let small = placed(&scene.splats, &scene.camera, 0.01, [0.0; 3]);
    let cut = small.1.clone().with_near(gs_core::image_formation::NEAR_PLANE);
    let background = render(&Splats::default(), &cut);
    assert_eq!(render(&small.0, &cut), background, "a scene nearer than the plane is not drawn");
    let middle = scene.camera.clone().with_near(3.0);
    let seen = render(&scene.splats, &middle);
    let behind: Vec<usize> = (0..scene.splats.len())
        .filter(|&i| camera_depth(&scene.camera, scene.splats.means[i]) > 3.0)
        .collect();
    assert!(behind.len() > 100 && behind.len() < 700, "{} splats", behind.len());
    let kept = render(&scene.splats.select(&behind), &middle);
    assert!(
        relative_l2(&widen(&seen), &widen(&kept)) < 1e-6,
        "the other splats are drawn as \
        before"
    );
}

fn camera_depth(camera: &Camera, mean: [f32; 3]) -> f64 {
    camera.to_camera(mean.map(f64::from))[2]
}
