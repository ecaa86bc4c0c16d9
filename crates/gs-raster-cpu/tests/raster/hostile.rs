//! Invalid input values never reach a pixel as NaN or infinity, and a
//! splat that is not finite is treated as absent.

use crate::scenes::{Scene, random, upstream};
use gs_core::{Rasterizer, RenderGrads, RenderOutput, RenderParams, UpstreamGrads};
use gs_raster_cpu::CpuRasterizer;

const VICTIM: usize = 7;
const FEATURES: usize = 2;

fn render(scene: &Scene<f32>, up: &UpstreamGrads<f32>) -> (RenderOutput, RenderGrads) {
    let raster = CpuRasterizer::default();
    let params = RenderParams { background: [0.1, 0.2, 0.3], ..RenderParams::default() };
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    let out = raster.forward(&mut prepared, &scene.splats, &scene.features, &params).unwrap();
    let grads =
        raster.backward(&mut prepared, &scene.splats, &scene.features, &params, up).unwrap();
    (out, grads)
}

fn assert_finite(what: &str, out: &RenderOutput, grads: &RenderGrads) {
    let planes = [&out.rgb, &out.alpha, &out.depth, &out.features];
    assert!(planes.iter().all(|plane| plane.iter().all(|v| v.is_finite())), "{what}: image");
    let arrays = [
        grads.v_means.as_flattened(),
        grads.v_quats.as_flattened(),
        grads.v_log_scales.as_flattened(),
        &grads.v_opacity_logits,
        grads.v_sh.as_flattened(),
        &grads.v_features,
        grads.v_means2d.as_flattened(),
    ];
    for (i, array) in arrays.iter().enumerate() {
        assert!(array.iter().all(|v| v.is_finite()), "{what}: gradient array {i}");
    }
}

fn assert_no_gradient(what: &str, grads: &RenderGrads) {
    let coeffs = grads.v_sh.len() / grads.v_means.len();
    let zero = grads.v_means[VICTIM] == [0.0; 3]
        && grads.v_quats[VICTIM] == [0.0; 4]
        && grads.v_log_scales[VICTIM] == [0.0; 3]
        && grads.v_opacity_logits[VICTIM] == 0.0
        && grads.v_sh[VICTIM * coeffs..(VICTIM + 1) * coeffs].iter().all(|v| *v == [0.0; 3])
        && grads.v_features[VICTIM * FEATURES..(VICTIM + 1) * FEATURES].iter().all(|v| *v == 0.0)
        && grads.v_means2d[VICTIM] == [0.0; 2];
    assert!(zero, "{what}: gradient of an absent splat");
}

type Lane = (&'static str, usize, fn(&mut Scene<f32>, usize) -> &mut f32);

const LANES: [Lane; 6] = [
    ("mean", 3, |s, i| &mut s.splats.means[VICTIM][i]),
    ("quat", 4, |s, i| &mut s.splats.quats[VICTIM][i]),
    ("log_scale", 3, |s, i| &mut s.splats.log_scales[VICTIM][i]),
    ("opacity_logit", 1, |s, _| &mut s.splats.opacity_logits[VICTIM]),
    ("sh", 4, |s, i| &mut s.splats.sh[9 * VICTIM + 2 * i][i % 3]),
    ("feature", FEATURES, |s, i| &mut s.features[FEATURES * VICTIM + i]),
];

#[test]
fn invalid_values_in_every_parameter() {
    let clean: Scene<f32> = random(40, FEATURES, [44, 35], 31);
    let up = upstream(44 * 35, FEATURES, 8);
    let mut absent = random(40, FEATURES, [44, 35], 31);
    absent.splats.means[VICTIM] = [0.0, 0.0, -90.0];
    let (without, grads_without) = render(&absent, &up);
    assert_no_gradient("behind", &grads_without);
    let (with, _) = render(&clean, &up);
    assert!(with != without, "control: the victim is visible");

    let poisons = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN,
        1e30,
        -1e30,
        1e19,
        60.0,
        -60.0,
        1e-40,
        -1e-40,
        0.0,
        -0.0,
    ];
    for (lane, width, access) in LANES {
        for component in 0..width {
            for poison in poisons {
                let what = format!("{lane} {component} = {poison:e}");
                let mut scene = random(40, FEATURES, [44, 35], 31);
                *access(&mut scene, component) = poison;
                let (out, grads) = render(&scene, &up);
                assert_finite(&what, &out, &grads);
                // A scale of zero and opacities of 0 and 1 are valid limits.
                let limit = lane == "opacity_logit" || (lane == "log_scale" && poison < 0.0);
                if poison.is_nan() || (poison.is_infinite() && !limit) {
                    assert!(out == without, "{what}: differs from the image without the splat");
                    assert_no_gradient(&what, &grads);
                    for id in (0..40).filter(|&id| id != VICTIM) {
                        assert_eq!(grads.v_means[id], grads_without.v_means[id], "{what}: {id}");
                    }
                }
            }
        }
    }
}

#[test]
fn zero_quaternion_and_zero_scale_are_drawn() {
    let up = upstream(44 * 35, FEATURES, 8);
    let mut scene: Scene<f32> = random(40, FEATURES, [44, 35], 31);
    scene.splats.quats[VICTIM] = [0.0; 4];
    scene.splats.log_scales[VICTIM] = [f32::NEG_INFINITY; 3];
    let (out, grads) = render(&scene, &up);
    assert_finite("zero rotation and scale", &out, &grads);
    assert!(
        grads.v_means[VICTIM] != [0.0; 3],
        "a splat of zero size is drawn with the low-pass \
        filter"
    );
    assert_eq!(grads.v_quats[VICTIM], [0.0; 4], "no rotation gradient");
    assert_eq!(grads.v_log_scales[VICTIM], [0.0; 3], "no scale gradient");
}

#[test]
fn a_scene_of_only_invalid_values_draws_nothing() {
    let up = upstream(20 * 20, 1, 8);
    let mut scene: Scene<f32> = random(300, 1, [20, 20], 31);
    for (i, mean) in scene.splats.means.iter_mut().enumerate() {
        mean[i % 3] = f32::NAN;
    }
    let (out, grads) = render(&scene, &up);
    assert_finite("all NaN", &out, &grads);
    assert!(out.alpha.iter().all(|&a| a == 0.0), "nothing is drawn");
}
