//! The exact gradients of every parameter group equal central differences in double precision.

use crate::scenes::{Scene, random, upstream};
use gs_core::{GradientConvention, Rasterizer, RenderGrads, RenderParams, UpstreamGrads};
use gs_raster_cpu::CpuRasterizer;

const PARAMS: RenderParams = RenderParams {
    background: [0.3, 0.6, 0.1],
    rgb: true,
    depth: true,
    gradients: GradientConvention::Exact,
};

fn loss(scene: &Scene<f64>, upstream: &UpstreamGrads<f64>) -> f64 {
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    let out = raster.forward(&mut prepared, &scene.splats, &scene.features, &PARAMS).unwrap();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(&out.rgb, &upstream.v_rgb)
        + dot(&out.alpha, &upstream.v_alpha)
        + dot(&out.depth, &upstream.v_depth)
        + dot(&out.features, &upstream.v_features)
}

type Access = fn(&mut Scene<f64>) -> &mut [f64];

fn check(what: &str, mut scene: Scene<f64>, seed: u64) {
    let pixels = (scene.camera.width * scene.camera.height) as usize;
    let num_features = scene.features.len() / scene.splats.len();
    let upstream = upstream(pixels, num_features, seed);
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    raster.forward(&mut prepared, &scene.splats, &scene.features, &PARAMS).unwrap();
    let grads: RenderGrads<f64> =
        raster.backward(&mut prepared, &scene.splats, &scene.features, &PARAMS, &upstream).unwrap();
    let groups: [(&str, Access, Vec<f64>); 6] = [
        ("means", |s| s.splats.means.as_flattened_mut(), grads.v_means.concat()),
        ("quats", |s| s.splats.quats.as_flattened_mut(), grads.v_quats.concat()),
        ("log_scales", |s| s.splats.log_scales.as_flattened_mut(), grads.v_log_scales.concat()),
        ("opacity_logits", |s| &mut s.splats.opacity_logits, grads.v_opacity_logits.clone()),
        ("sh", |s| s.splats.sh.as_flattened_mut(), grads.v_sh.concat()),
        ("features", |s| &mut s.features, grads.v_features.clone()),
    ];
    for (group, values, analytic) in groups {
        let largest = analytic.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!(largest > 0.0, "{what} {group}: no gradient");
        let mut flips = 0;
        for i in 0..analytic.len() {
            let original = values(&mut scene)[i];
            let mut at = |step: f64| {
                values(&mut scene)[i] = original + step;
                loss(&scene, &upstream)
            };
            // Two stencils: if a discrete decision flips inside one of them,
            // they disagree and the parameter is skipped.
            let h = 1e-5;
            let near = (at(h) - at(-h)) / (2.0 * h);
            let far = (at(2.0 * h) - at(-2.0 * h)) / (4.0 * h);
            values(&mut scene)[i] = original;
            if (near - far).abs() > 1e-5 * largest {
                flips += 1;
                continue;
            }
            let fourth_order = (4.0 * near - far) / 3.0;
            let error = (fourth_order - analytic[i]).abs();
            let scale = analytic[i].abs().max(1e-3 * largest);
            assert!(
                error <= 1e-5 * scale,
                "{what} {group} {i}: {:e}, differences give {fourth_order:e} (largest {largest:e})",
                analytic[i]
            );
        }
        assert!(flips * 10 <= analytic.len(), "{what} {group}: {flips} parameters skipped");
    }
}

#[test]
fn plain_scene() {
    check("plain", random(8, 2, [30, 22], 21), 1);
}

#[test]
fn capped_stopped_and_clamped() {
    let mut scene = random(10, 2, [26, 20], 22);
    for i in 0..10 {
        scene.splats.opacity_logits[i] += 4.5;
        scene.splats.sh[9 * i][i % 3] -= 2.0;
    }
    check("opaque", scene, 2);
}

/// Close to the camera and far to the side, beyond 1.3 half fields of view, with a footprint that
/// still reaches the image.
#[test]
fn guard_band() {
    let mut scene = random(6, 1, [24, 24], 23);
    for i in 0..6 {
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        scene.splats.means[i] = [side * (1.9 + 0.1 * i as f64), 0.2 * i as f64 - 0.5, -0.4];
        scene.splats.log_scales[i] = [-0.4, -0.9, -0.6];
    }
    check("guard band", scene, 3);
}

#[test]
fn many_channels() {
    check("channels", random(5, 9, [20, 18], 24), 4);
}
