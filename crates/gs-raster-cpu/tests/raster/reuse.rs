//! Results are bit-identical for any number of threads, with reused memory and with outdated lists.

use crate::scenes::{Scene, random, upstream};
use gs_core::{
    RasterError, Rasterizer, RenderGrads, RenderOutput, RenderParams, TileSet, UpstreamGrads,
};
use gs_raster_cpu::{CpuRasterizer, Prepared};

const PARAMS: RenderParams = RenderParams {
    background: [0.1, 0.2, 0.3],
    rgb: true,
    depth: true,
    gradients: gs_core::GradientConvention::Reference,
};

fn run(
    raster: CpuRasterizer,
    prepared: &mut Prepared<f32>,
    scene: &Scene<f32>,
    up: &UpstreamGrads<f32>,
) -> (RenderOutput, RenderGrads, RenderGrads) {
    let Scene { splats, features, .. } = scene;
    let out = raster.forward(prepared, splats, features, &PARAMS).unwrap();
    let grads = raster.backward(prepared, splats, features, &PARAMS, up).unwrap();
    let colors = raster.backward_colors(prepared, splats, features, &PARAMS, up).unwrap();
    (out, grads, colors)
}

fn fresh(
    raster: CpuRasterizer,
    scene: &Scene<f32>,
    up: &UpstreamGrads<f32>,
) -> (RenderOutput, RenderGrads, RenderGrads) {
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    run(raster, &mut prepared, scene, up)
}

#[test]
fn results_are_equal_for_any_number_of_threads() {
    let scene = random(9000, 1, [210, 150], 41);
    let up = upstream(210 * 150, 1, 4);
    let results: Vec<_> = [1, 2, 3, 7]
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| fresh(CpuRasterizer::default(), &scene, &up))
        })
        .into();
    for (i, result) in results.iter().enumerate() {
        assert!(*result == results[0], "run {i} differs from the one with a single thread");
    }
}

#[test]
fn reused_memory_does_not_affect_results() {
    let raster = CpuRasterizer::default();
    let mut prepared = Prepared::default();
    let (mut out, mut grads) = (RenderOutput::default(), RenderGrads::default());
    for (count, size, num_features) in [
        (900, [120, 80], 3),
        (50, [33, 70], 0),
        (0, [40, 20], 0),
        (400, [150, 30], 6),
        (900, [120, 80], 3),
    ] {
        let scene = random(count, num_features, size, 43);
        let up =
            upstream((size[0] * size[1]) as usize, if count == 0 { 0 } else { num_features }, 5);
        let Scene { splats, features, camera } = &scene;
        raster.prepare_into(splats, camera, &mut prepared).unwrap();
        raster.forward_into(&mut prepared, splats, features, &PARAMS, &mut out).unwrap();
        raster.backward_into(&mut prepared, splats, features, &PARAMS, &up, &mut grads).unwrap();
        let (fresh_out, fresh_grads, _) = fresh(raster, &scene, &up);
        assert!(out == fresh_out && grads == fresh_grads, "{count} splats, {size:?}");
    }
}

/// Only geometry and camera are prepared: colours, features and opacities (up or down) may change
/// afterwards.
#[test]
fn prepared_state_stays_valid_for_new_colors_and_opacities() {
    let raster = CpuRasterizer::default();
    let mut scene = random(600, 1, [100, 75], 44);
    let up = upstream(100 * 75, 1, 6);
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    for (step, shift) in [0.0, 3.0, -5.0, 4.0].into_iter().enumerate() {
        for logit in &mut scene.splats.opacity_logits {
            *logit += shift;
        }
        scene.splats.sh.reverse();
        scene.features.reverse();
        let reused = run(raster, &mut prepared, &scene, &up);
        assert!(reused == fresh(raster, &scene, &up), "step {step}");
        if step == 2 {
            prepared.trim();
        }
    }
}

#[test]
fn planes_that_are_not_requested_are_empty() {
    let scene = random::<f32>(60, 2, [40, 30], 45);
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    let all = raster.forward(&mut prepared, &scene.splats, &scene.features, &PARAMS).unwrap();
    let params = RenderParams { rgb: false, depth: false, ..PARAMS };
    let some = raster.forward(&mut prepared, &scene.splats, &scene.features, &params).unwrap();
    assert!(some.rgb.is_empty() && some.depth.is_empty(), "not requested");
    assert_eq!(some.features, all.features, "features do not depend on the other planes");
    assert_eq!(some.alpha, all.alpha, "neither does alpha");
    let none = raster.forward(&mut prepared, &scene.splats, &[], &params).unwrap();
    assert_eq!(none.alpha, all.alpha, "alpha alone");
    assert!(none.features.is_empty(), "no features");
    let image = all.rgb_image();
    assert_eq!((image.width, image.height, image.channels), (40, 30, 3), "as an image");
}

/// The backward pass of one channel gives the weight `Σ m α T` of a mask in each splat; summed over
/// all splats it equals the sum of alpha.
#[test]
fn mask_weights_sum_to_alpha() {
    let scene = random::<f32>(300, 0, [64, 48], 46);
    let raster = CpuRasterizer::default();
    let params = RenderParams { rgb: false, depth: false, ..PARAMS };
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    let feature = vec![0.0; 300];
    let out = raster.forward(&mut prepared, &scene.splats, &feature, &params).unwrap();
    let up = UpstreamGrads { v_features: vec![1.0; 64 * 48], ..UpstreamGrads::default() };
    let weights =
        raster.backward_colors(&mut prepared, &scene.splats, &feature, &params, &up).unwrap();
    let (weights, alpha): (f32, f32) = (weights.v_features.iter().sum(), out.alpha.iter().sum());
    assert!((weights - alpha).abs() < 1e-4 * alpha, "{weights} weights, {alpha} pixels covered");
}

/// Restricted to some tiles: the same bits at their pixels, the background elsewhere, and the same
/// gradients for an upstream gradient inside them.
#[test]
fn tiles_are_rendered_as_in_the_whole_image() {
    let (width, height) = (150, 90);
    let scene = random::<f32>(900, 1, [150, 90], 48);
    let Scene { splats, camera, .. } = &scene;
    let raster = CpuRasterizer::default();
    let mut tiles = TileSet::new(width, height);
    tiles.insert([20, 10, 50, 40]);
    tiles.insert([140, 80, 141, 81]);
    let mut up = upstream(width * height, 1, 7);
    let outside = |p: usize| !tiles.contains(p % width, p / width);
    for p in (0..width * height).filter(|&p| outside(p)) {
        up.v_rgb[3 * p..3 * p + 3].fill(0.0);
        for plane in [&mut up.v_alpha, &mut up.v_depth, &mut up.v_features] {
            plane[p] = 0.0;
        }
    }
    let (whole, whole_grads, whole_colors) = fresh(raster, &scene, &up);
    // The memory contained a different, larger image before.
    let mut prepared = raster.prepare(splats, &random::<f32>(1, 0, [170, 120], 1).camera).unwrap();
    raster.prepare_tiles_into(splats, camera, &tiles, &mut prepared).unwrap();
    let all = raster.prepare(splats, camera).unwrap();
    assert!(prepared.num_visible() < all.num_visible(), "fewer splats");
    assert!(prepared.num_isects() * 4 < all.num_isects(), "fewer list entries");
    for _ in 0..2 {
        let (part, grads, colors) = run(raster, &mut prepared, &scene, &up);
        for p in 0..width * height {
            if outside(p) {
                assert!(part.alpha[p] == 0.0 && part.features[p] == 0.0, "pixel {p}: nothing");
                let rgb = [0.1, 0.2, 0.3];
                assert_eq!(part.rgb[3 * p..3 * p + 3], rgb, "pixel {p}: background");
            } else {
                assert_eq!(part.alpha[p], whole.alpha[p], "pixel {p}");
                assert_eq!(part.depth[p], whole.depth[p], "pixel {p}");
                assert_eq!(part.features[p], whole.features[p], "pixel {p}");
                assert_eq!(part.rgb[3 * p..3 * p + 3], whole.rgb[3 * p..3 * p + 3], "pixel {p}");
            }
        }
        assert!(grads == whole_grads && colors == whole_colors, "gradients");
    }
    // An ordinary preparation of the same memory has all tiles again.
    raster.prepare_into(splats, camera, &mut prepared).unwrap();
    assert!(run(raster, &mut prepared, &scene, &up).0 == whole, "the whole image");

    let other = TileSet::new(width, height + 16);
    let refused = raster.prepare_tiles_into(splats, camera, &other, &mut prepared);
    assert!(matches!(refused, Err(RasterError::Shape { what: "tiles", .. })), "{refused:?}");
}

/// Sums of planes per splat equal those of a forward and a backward pass, and invalidate the last
/// forward pass.
#[test]
fn sums_need_no_forward_pass() {
    let scene = random::<f32>(500, 2, [100, 75], 49);
    let Scene { splats, features, camera } = &scene;
    let raster = CpuRasterizer::default();
    let params = RenderParams { rgb: false, depth: false, ..PARAMS };
    let up = UpstreamGrads {
        v_features: upstream::<f32>(100 * 75, 2, 8).v_features,
        ..UpstreamGrads::default()
    };
    let mut prepared = raster.prepare(splats, camera).unwrap();
    let mut sums = RenderGrads::default();
    raster.lift_into(&mut prepared, splats, &up, 2, &mut sums).unwrap();
    let mut other = raster.prepare(splats, camera).unwrap();
    raster.forward(&mut other, splats, features, &params).unwrap();
    let grads = raster.backward_colors(&mut other, splats, features, &params, &up).unwrap();
    assert_eq!(sums.v_features, grads.v_features);
    assert!(sums.v_features.iter().any(|&sum| sum != 0.0), "not all zero");
    raster.forward(&mut prepared, splats, features, &params).unwrap();
    raster.lift_into(&mut prepared, splats, &up, 2, &mut sums).unwrap();
    let stale = raster.backward(&mut prepared, splats, features, &params, &up);
    assert!(matches!(stale, Err(RasterError::NoForward)), "{stale:?}");
    let short = UpstreamGrads { v_features: vec![0.0; 7], ..UpstreamGrads::default() };
    let refused = raster.lift_into(&mut prepared, splats, &short, 2, &mut sums);
    assert!(matches!(refused, Err(RasterError::Shape { what: "v_features", .. })), "{refused:?}");
}

#[test]
fn invalid_arguments_are_errors() {
    let scene = random::<f32>(10, 1, [20, 20], 47);
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&scene.splats, &scene.camera).unwrap();
    let up = UpstreamGrads::default();
    let Scene { splats, features, camera } = &scene;
    let early = raster.backward(&mut prepared, splats, features, &PARAMS, &up);
    assert!(matches!(early, Err(RasterError::NoForward)), "backward first: {early:?}");
    let shape = raster.forward(&mut prepared, splats, &features[..7], &PARAMS);
    assert!(matches!(shape, Err(RasterError::Shape { what: "features", .. })), "{shape:?}");
    let other = random::<f32>(11, 1, [20, 20], 47);
    let shape = raster.forward(&mut prepared, &other.splats, features, &PARAMS);
    assert!(matches!(shape, Err(RasterError::Shape { what: "splats", .. })), "{shape:?}");
    raster.forward(&mut prepared, splats, features, &PARAMS).unwrap();
    let up = UpstreamGrads { v_rgb: vec![0.0; 5], ..UpstreamGrads::default() };
    let shape = raster.backward(&mut prepared, splats, features, &PARAMS, &up);
    assert!(matches!(shape, Err(RasterError::Shape { what: "v_rgb", .. })), "{shape:?}");
    let mut blind = camera.clone();
    blind.width = 0;
    assert!(raster.prepare(splats, &blind).is_err(), "no columns");
    let mut ragged = splats.clone();
    ragged.quats.pop();
    assert!(raster.prepare(&ragged, camera).is_err(), "ragged arrays");
}
