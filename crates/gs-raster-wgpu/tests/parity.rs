//! Images and gradients equal those of the CPU rasteriser, on five scenes and at awkward sizes;
//! `stages` tests the stages before them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use common::{MODES, Mode, Scene, awkward_scenes, camera, cloud, noise, raster, scenes};
use gs_core::{
    Camera, GradientConvention, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats,
    UpstreamGrads,
};
use gs_raster_cpu::CpuRasterizer;
use test_support::compare::{assert_grad_close, relative_l2};
use test_support::raster::{widen, widen_rows};

const BACKGROUND: [f64; 3] = [0.2, 0.5, 0.8];

fn params() -> RenderParams {
    RenderParams { background: BACKGROUND, ..RenderParams::default() }
}

fn features(scene: &Scene, num: usize) -> Vec<f32> {
    noise(77, num * scene.splats.len())
}

fn upstream(out: &RenderOutput) -> UpstreamGrads {
    UpstreamGrads {
        v_rgb: noise(1, out.rgb.len()),
        v_alpha: noise(2, out.alpha.len()),
        v_depth: noise(3, out.depth.len()),
        v_features: noise(4, out.features.len()),
    }
}

/// Fraction of values that are off by more than 1e-3, and the mean error.
fn image_errors(ours: &[f32], theirs: &[f32]) -> (f64, f64) {
    assert_eq!(ours.len(), theirs.len(), "plane lengths");
    let errors = ours.iter().zip(theirs).map(|(a, b)| f64::from((a - b).abs()));
    let (mut off, mut sum) = (0, 0.0);
    for error in errors {
        assert!(error.is_finite(), "a value is not finite");
        off += usize::from(error > 1e-3);
        sum += error;
    }
    let len = ours.len().max(1) as f64;
    (off as f64 / len, sum / len)
}

fn assert_images_match(what: &str, ours: &RenderOutput, theirs: &RenderOutput) {
    let planes = [
        ("rgb", &ours.rgb, &theirs.rgb),
        ("alpha", &ours.alpha, &theirs.alpha),
        ("depth", &ours.depth, &theirs.depth),
        ("features", &ours.features, &theirs.features),
    ];
    for (plane, ours, theirs) in planes {
        let (off, mean) = image_errors(ours, theirs);
        // Decisions at a threshold may differ: in a few pixels, by at most a few thousandths.
        assert!(
            mean < 1e-5 && off <= 1e-3,
            "{what} {plane}: mean error {mean:e}, {off:e} of the values off"
        );
    }
}

fn assert_grads_match(what: &str, ours: &RenderGrads, theirs: &RenderGrads, limit: f64) {
    let pairs = [
        ("means", widen_rows(&ours.v_means), widen_rows(&theirs.v_means)),
        ("quats", widen_rows(&ours.v_quats), widen_rows(&theirs.v_quats)),
        ("log_scales", widen_rows(&ours.v_log_scales), widen_rows(&theirs.v_log_scales)),
        ("opacities", widen(&ours.v_opacity_logits), widen(&theirs.v_opacity_logits)),
        ("sh", widen_rows(&ours.v_sh), widen_rows(&theirs.v_sh)),
        ("features", widen(&ours.v_features), widen(&theirs.v_features)),
        ("means2d", widen_rows(&ours.v_means2d), widen_rows(&theirs.v_means2d)),
    ];
    for (tensor, ours, theirs) in pairs {
        let error = relative_l2(&ours, &theirs);
        assert!(error <= limit, "{what} {tensor}: relative L2 {error:e}");
        let all_zero = ours.iter().all(|&v| v == 0.0) && theirs.iter().any(|&v| v != 0.0);
        assert!(!all_zero, "{what} {tensor}: all zero");
    }
}

struct Both {
    out: RenderOutput,
    grads: RenderGrads,
}

fn cpu(splats: &Splats, camera: &Camera, features: &[f32], params: &RenderParams) -> Both {
    let cpu = CpuRasterizer::default();
    let mut prepared = cpu.prepare(splats, camera).unwrap();
    let out = cpu.forward(&mut prepared, splats, features, params).unwrap();
    let grads = cpu.backward(&mut prepared, splats, features, params, &upstream(&out)).unwrap();
    Both { out, grads }
}

fn gpu(
    mode: Mode,
    splats: &Splats,
    camera: &Camera,
    features: &[f32],
    params: &RenderParams,
) -> Both {
    let raster = raster(mode);
    let mut prepared = raster.prepare(splats, camera).unwrap();
    let out = raster.forward(&mut prepared, splats, features, params).unwrap();
    let grads = raster.backward(&mut prepared, splats, features, params, &upstream(&out)).unwrap();
    Both { out, grads }
}

#[test]
fn images_and_gradients_match_on_five_scenes() {
    for scene in scenes() {
        let features = features(&scene, 2);
        let params = params();
        let theirs = cpu(&scene.splats, &scene.camera, &features, &params);
        for mode in [Mode::Portable, Mode::Native] {
            let ours = gpu(mode, &scene.splats, &scene.camera, &features, &params);
            let what = format!("{mode:?} {}", scene.name);
            assert_images_match(&what, &ours.out, &theirs.out);
            assert_grads_match(&what, &ours.grads, &theirs.grads, 1e-3);
        }
    }
}

#[test]
fn awkward_sizes_match() {
    for Scene { name, splats, camera } in &awkward_scenes() {
        let features = noise(5, splats.len());
        let theirs = cpu(splats, camera, &features, &params());
        for mode in [Mode::Portable, Mode::Native] {
            let ours = gpu(mode, splats, camera, &features, &params());
            assert_images_match(name, &ours.out, &theirs.out);
            assert_grads_match(name, &ours.grads, &theirs.grads, 1e-3);
        }
    }
}

/// Any subset of channels, and more channels than fit one pass.
#[test]
fn channels_can_be_selected() {
    let scene = &scenes()[1];
    for (rgb, depth, num_features) in [
        (false, false, 0),
        (false, false, 1),
        (false, true, 3),
        (true, false, 1),
        (true, true, 8),
        (true, true, 13),
    ] {
        let features = features(scene, num_features);
        let params = RenderParams { rgb, depth, ..params() };
        let theirs = cpu(&scene.splats, &scene.camera, &features, &params);
        for mode in [Mode::Portable, Mode::Native] {
            let ours = gpu(mode, &scene.splats, &scene.camera, &features, &params);
            let what = format!("{mode:?} rgb {rgb}, depth {depth}, {num_features} features");
            assert_images_match(&what, &ours.out, &theirs.out);
            assert_grads_match(&what, &ours.grads, &theirs.grads, 1e-3);
        }
    }
}

#[test]
fn exact_gradients_match() {
    let scene = &scenes()[2];
    let params = RenderParams { gradients: GradientConvention::Exact, ..params() };
    let theirs = cpu(&scene.splats, &scene.camera, &[], &params);
    let ours = gpu(Mode::Portable, &scene.splats, &scene.camera, &[], &params);
    assert_grads_match("exact", &ours.grads, &theirs.grads, 1e-3);
}

/// Splitting harmonics and gradients of pairs that exceed a binding does not change the result.
#[test]
fn splitting_does_not_change_the_result() {
    let (splats, camera) = (cloud(11, 9000, 3, -3.5), camera(64, 48));
    let whole = gpu(Mode::Portable, &splats, &camera, &[], &params());
    let split = gpu(Mode::Tiny, &splats, &camera, &[], &params());
    assert!(12 * splats.sh.len() > 640 << 10, "the scene is large enough to be split");
    assert_eq!(whole.out, split.out, "image");
    // Slots are added in the same order with and without splitting.
    assert_grads_match("split", &split.grads, &whole.grads, 1e-6);
}

/// A prepared state reused with new colours, opacities and features gives the image of a new one.
#[test]
fn prepared_state_is_reused_when_only_colours_and_opacities_change() {
    for mode in MODES {
        let scene = &scenes()[1];
        let raster = raster(mode);
        let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
        raster.forward(&mut prepared, &scene.splats, &[], &params()).unwrap();
        let mut changed = scene.splats.clone();
        for (logit, extra) in changed.opacity_logits.iter_mut().zip(noise(6, 400)) {
            *logit += 5.0 * extra;
        }
        for (rgb, extra) in changed.sh.iter_mut().zip(noise(7, 4000)) {
            rgb[0] += extra;
        }
        let features = features(scene, 2);
        let reused = raster.forward(&mut prepared, &changed, &features, &params()).unwrap();
        let mut fresh = raster.prepare(&changed, &scene.camera).unwrap();
        let expected = raster.forward(&mut fresh, &changed, &features, &params()).unwrap();
        assert_eq!(reused, expected, "{mode:?}");
    }
}

/// Memory of an earlier camera, scene and size is reused, growing and shrinking.
#[test]
fn prepare_into_equals_prepare() {
    let raster = raster(Mode::Portable);
    let mut reused = raster.prepare(&cloud(1, 3, 0, -2.0), &camera(8, 8)).unwrap();
    for scene in scenes() {
        raster.prepare_into(&scene.splats, &scene.camera, &mut reused).unwrap();
        let ours = raster.forward(&mut reused, &scene.splats, &[], &params()).unwrap();
        let mut fresh = raster.prepare(&scene.splats, &scene.camera).unwrap();
        let expected = raster.forward(&mut fresh, &scene.splats, &[], &params()).unwrap();
        assert_eq!(ours, expected, "{}", scene.name);
    }
}

/// A pixel mask as the upstream gradient of one feature gives the mask's weight in each splat.
#[test]
fn a_mask_as_gradient_gives_weights_of_splats() {
    let scene = &scenes()[0];
    let ones = vec![1.0; scene.splats.len()];
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    for mode in MODES {
        let raster = raster(mode);
        let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
        let out = raster.forward(&mut prepared, &scene.splats, &ones, &params).unwrap();
        let mask: Vec<f32> =
            (0..out.alpha.len()).map(|i| if i % 3 == 0 { 1.0 } else { 0.0 }).collect();
        let upstream = UpstreamGrads { v_features: mask.clone(), ..UpstreamGrads::default() };
        let grads = raster
            .backward_colors(&mut prepared, &scene.splats, &ones, &params, &upstream)
            .unwrap();
        let weights: f64 = widen(&grads.v_features).iter().sum();
        let covered: f64 =
            out.alpha.iter().zip(&mask).map(|(&a, &m)| f64::from(a) * f64::from(m)).sum();
        assert!(
            (weights - covered).abs() < 1e-4 * covered,
            "{mode:?}: {weights} weights, {covered} covered"
        );
    }
}

#[test]
fn colour_only_gradients_match_the_cpu() {
    let scene = &scenes()[0];
    let features = features(scene, 2);
    let raster = raster(Mode::Portable);
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    let out = raster.forward(&mut prepared, &scene.splats, &features, &params()).unwrap();
    let up = upstream(&out);
    let ours =
        raster.backward_colors(&mut prepared, &scene.splats, &features, &params(), &up).unwrap();
    let theirs = cpu(&scene.splats, &scene.camera, &features, &params());
    assert_grad_close("sh", &widen_rows(&ours.v_sh), &widen_rows(&theirs.grads.v_sh), 1e-3);
    assert_grad_close("features", &widen(&ours.v_features), &widen(&theirs.grads.v_features), 1e-3);
}

/// Splats on the device, with a different camera or moved, give the image of a new upload.
#[test]
fn resident_splats_give_the_same_image() {
    let scene = &scenes()[1];
    let features = features(scene, 2);
    let raster = raster(Mode::Portable);
    let fresh = |splats: &Splats, camera: &Camera| {
        let mut prepared = raster.prepare(splats, camera).unwrap();
        raster.forward(&mut prepared, splats, &features, &params()).unwrap()
    };
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    let mut out = RenderOutput::default();
    let error = raster.forward_resident_into(&mut prepared, &params(), &mut out).unwrap_err();
    assert!(matches!(error, gs_core::RasterError::NoForward), "no colours yet: {error}");
    raster.forward_into(&mut prepared, &scene.splats, &features, &params(), &mut out).unwrap();

    let elsewhere = Camera::look_at([1.0, 0.5, -3.0], [0.0; 3], [0.0, 1.0, 0.0], 1.0, 90, 30);
    raster.set_camera(&mut prepared, &elsewhere).unwrap();
    raster.forward_resident_into(&mut prepared, &params(), &mut out).unwrap();
    assert_eq!(out, fresh(&scene.splats, &elsewhere), "a different camera");

    let mut moved = scene.splats.clone();
    for mean in &mut moved.means {
        mean[1] += 0.2;
    }
    raster.prepare_into(&moved, &elsewhere, &mut prepared).unwrap();
    raster.forward_resident_into(&mut prepared, &params(), &mut out).unwrap();
    assert_eq!(out, fresh(&moved, &elsewhere), "moved splats");

    let other = RenderParams { depth: false, ..params() };
    assert!(
        raster.forward_resident_into(&mut prepared, &other, &mut out).is_err(),
        "other channels"
    );
}

/// Every pass of a frame is timed where the adapter supports it; otherwise the timings are empty.
#[test]
fn passes_are_timed_where_supported() {
    let scene = &scenes()[1];
    for mode in [Mode::Native, Mode::Portable] {
        let raster = raster(mode);
        let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
        raster.forward(&mut prepared, &scene.splats, &[], &params()).unwrap();
        let timings = raster.timings(&prepared);
        let expected = mode == Mode::Native && raster.context().adapter().timestamps;
        assert_eq!(!timings.is_empty(), expected, "{mode:?}: {timings:?}");
        if expected {
            for pass in ["Project", "Compact", "SortScatter", "EmitIsects", "Shade4", "Rasterize4"]
            {
                assert!(timings.iter().any(|timing| timing.name == pass), "{pass} is not timed");
            }
        }
    }
}

/// The planes can remain on the device, and a backward pass works as usual.
#[test]
fn planes_can_remain_on_the_device() {
    let scene = &scenes()[1];
    let raster = raster(Mode::Portable);
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    assert!(raster.image_buffer(&prepared).is_err(), "no image yet");
    raster.forward_on_device(&mut prepared, &scene.splats, &[], &params()).unwrap();
    let pixels = scene.camera.width * scene.camera.height;
    let bytes = raster.image_buffer(&prepared).unwrap().size();
    assert!(bytes >= u64::from(4 * 5 * pixels), "colour, alpha, depth: {bytes} bytes");
    let upstream =
        UpstreamGrads { v_alpha: vec![1.0; pixels as usize], ..UpstreamGrads::default() };
    let grads = raster.backward(&mut prepared, &scene.splats, &[], &params(), &upstream).unwrap();
    assert!(grads.v_opacity_logits.iter().any(|&v| v > 0.0), "more opacity, more alpha");
}

/// Negative control: the comparators detect the image and gradients of a different scene.
#[test]
fn a_different_scene_is_detected() {
    let (one, other) = (cloud(1, 200, 1, -2.5), cloud(2, 200, 1, -2.5));
    let (a, b) = (
        cpu(&one, &camera(48, 40), &[], &params()),
        gpu(Mode::Portable, &other, &camera(48, 40), &[], &params()),
    );
    let refused =
        |work: &(dyn Fn() + std::panic::RefUnwindSafe)| std::panic::catch_unwind(work).is_err();
    assert!(refused(&|| assert_images_match("control", &b.out, &a.out)), "image");
    assert!(refused(&|| assert_grads_match("control", &b.grads, &a.grads, 1e-3)), "gradients");
}
