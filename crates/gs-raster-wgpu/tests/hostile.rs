//! Hostile values, invalid arguments and lack of memory give finite images or errors.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use common::{Mode, camera, choice, cloud, noise, raster};
use gs_core::{
    RasterError, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads,
};
use gs_raster_cpu::CpuRasterizer;
use gs_raster_wgpu::{AdapterChoice, GpuContext, GpuOptions, WgpuRasterizer};

const POISON: [f32; 12] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    1e-40,
    -1e-40,
    f32::MIN_POSITIVE,
    f32::MAX,
    f32::MIN,
    1e20,
    -1e20,
    1e9,
    0.0,
];

/// Number of parameters of a splat with harmonics of degree 1.
const LANES: usize = 3 + 4 + 3 + 1 + 12;

fn poison(splats: &mut Splats, id: usize, lane: usize, value: f32) {
    match lane {
        0..3 => splats.means[id][lane] = value,
        3..7 => splats.quats[id][lane - 3] = value,
        7..10 => splats.log_scales[id][lane - 7] = value,
        10 => splats.opacity_logits[id] = value,
        _ => splats.sh[4 * id + (lane - 11) / 3][(lane - 11) % 3] = value,
    }
}

fn run<R: Rasterizer>(raster: &R, splats: &Splats) -> (RenderOutput, RenderGrads) {
    let params = RenderParams { background: [0.3; 3], ..RenderParams::default() };
    let mut prepared = raster.prepare(splats, &camera(40, 32)).unwrap();
    let out = raster.forward(&mut prepared, splats, &[], &params).unwrap();
    let upstream = UpstreamGrads {
        v_rgb: noise(1, out.rgb.len()),
        v_alpha: noise(2, out.alpha.len()),
        v_depth: noise(3, out.depth.len()),
        v_features: Vec::new(),
    };
    let grads = raster.backward(&mut prepared, splats, &[], &params, &upstream).unwrap();
    (out, grads)
}

fn all_finite(out: &RenderOutput, grads: &RenderGrads) -> bool {
    let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
    finite(&out.rgb)
        && finite(&out.alpha)
        && finite(&out.depth)
        && finite(grads.v_means.as_flattened())
        && finite(grads.v_quats.as_flattened())
        && finite(grads.v_log_scales.as_flattened())
        && finite(&grads.v_opacity_logits)
        && finite(grads.v_sh.as_flattened())
        && finite(grads.v_means2d.as_flattened())
}

/// Colours near the largest float are finite, but their sums in an image are not.
fn overflows(lane: usize, value: f32) -> bool {
    lane >= 11 && value.is_finite() && value.abs() > 1e30
}

fn without(splats: &Splats, id: usize) -> Splats {
    let kept: Vec<usize> = (0..splats.len()).filter(|&i| i != id).collect();
    splats.select(&kept)
}

/// Each invalid value in each parameter of one splat: images and gradients stay finite; where the
/// CPU culls the splat, the image equals the one without it and its gradients are zero.
#[test]
fn invalid_values_in_every_parameter_leave_images_and_gradients_finite() {
    for mode in [Mode::Portable, Mode::Native] {
        check_poison(mode, 5);
    }
}

fn check_poison(mode: Mode, id: usize) {
    let clean = cloud(12, 12, 1, -1.5);
    let raster = raster(mode);
    let (absent, _) = run(&raster, &without(&clean, id));
    let mut culled = 0;
    for lane in 0..LANES {
        for value in POISON {
            let mut splats = clean.clone();
            poison(&mut splats, id, lane, value);
            let (out, grads) = run(&raster, &splats);
            let what = format!("{mode:?} lane {lane} = {value:e}");
            assert!(all_finite(&out, &grads) || overflows(lane, value), "{what}: not finite");
            if !value.is_finite() {
                let keeps = (lane == 10 && !value.is_nan())
                    || (7..10).contains(&lane) && value == f32::NEG_INFINITY;
                if !keeps {
                    culled += 1;
                    assert_eq!(out, absent, "{what}: differs from the image without the splat");
                    let zero = grads.v_means[id] == [0.0; 3]
                        && grads.v_quats[id] == [0.0; 4]
                        && grads.v_log_scales[id] == [0.0; 3]
                        && grads.v_opacity_logits[id] == 0.0
                        && grads.v_sh[4 * id..4 * id + 4].iter().all(|v| *v == [0.0; 3]);
                    assert!(zero, "{what}: gradient of a culled splat");
                }
            }
        }
    }
    assert_eq!(culled, 3 * (LANES - 1 - 3) + 1 + 2 * 3, "every parameter was tested");
}

/// Valid extreme values (denormal, zero, huge but finite) give the image of the CPU rasteriser.
#[test]
fn extreme_finite_values_match_the_cpu() {
    let id = 3;
    let clean = cloud(13, 10, 1, -1.5);
    let raster = raster(Mode::Portable);
    let mut cases: Vec<(String, Splats)> = Vec::new();
    for lane in 0..LANES {
        for value in POISON.into_iter().filter(|&v| v.is_finite() && !overflows(lane, v)) {
            let mut splats = clean.clone();
            poison(&mut splats, id, lane, value);
            cases.push((format!("lane {lane} = {value:e}"), splats));
        }
    }
    let mut splats = clean.clone();
    splats.quats[id] = [0.0; 4];
    cases.push(("zero quaternion".to_owned(), splats));
    for log_scale in [f32::NEG_INFINITY, -200.0, 20.0, 40.0, 44.0, 60.0, 88.0, 1000.0] {
        let mut splats = clean.clone();
        splats.log_scales[id] = [log_scale; 3];
        cases.push((format!("log-scales {log_scale}"), splats));
    }
    for (what, splats) in cases {
        let (out, grads) = run(&raster, &splats);
        assert!(all_finite(&out, &grads), "{what}: not finite");
        let (expected, _) = run(&CpuRasterizer::default(), &splats);
        let pairs = out.rgb.iter().zip(&expected.rgb);
        let off = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-3 * (1.0 + b.abs())).count();
        assert!(off <= 6, "{what}: {off} values differ from the CPU's");
    }
}

#[test]
fn a_scene_of_only_invalid_values_is_background() {
    let mut splats = cloud(14, 64, 1, -2.0);
    for (i, mean) in splats.means.iter_mut().enumerate() {
        mean[i % 3] = f32::NAN;
    }
    let (out, grads) = run(&raster(Mode::Native), &splats);
    assert!(out.rgb.iter().all(|&v| (v - 0.3).abs() < 1e-6), "background");
    assert!(out.alpha.iter().all(|&v| v == 0.0), "transparent");
    assert!(grads.v_means.iter().all(|v| *v == [0.0; 3]), "no gradient");
}

#[test]
fn features_that_are_not_finite_remove_their_splat() {
    let splats = cloud(15, 20, 0, -2.0);
    let raster = raster(Mode::Portable);
    let params = RenderParams::default();
    let mut features = noise(1, 2 * splats.len());
    features[2 * 7 + 1] = f32::NAN;
    let mut prepared = raster.prepare(&splats, &camera(40, 32)).unwrap();
    let out = raster.forward(&mut prepared, &splats, &features, &params).unwrap();
    let kept = without(&splats, 7);
    features.drain(14..16);
    let mut prepared = raster.prepare(&kept, &camera(40, 32)).unwrap();
    let expected = raster.forward(&mut prepared, &kept, &features, &params).unwrap();
    assert_eq!(out, expected, "image");
}

#[test]
fn invalid_arguments_are_explained() {
    let raster = raster(Mode::Portable);
    let splats = cloud(16, 10, 1, -2.0);
    let params = RenderParams::default();
    let mut prepared = raster.prepare(&splats, &camera(16, 16)).unwrap();
    let upstream = UpstreamGrads::default();
    let error = raster.backward(&mut prepared, &splats, &[], &params, &upstream).unwrap_err();
    assert!(matches!(error, RasterError::NoForward), "{error}");
    let error = raster.forward(&mut prepared, &splats, &[0.0; 15], &params).unwrap_err();
    assert!(error.to_string().contains("`features` has 15 values"), "{error}");
    let error = raster.forward(&mut prepared, &cloud(1, 9, 1, -2.0), &[], &params).unwrap_err();
    assert!(error.to_string().contains("`splats` has 9 values, expected 10"), "{error}");
    raster.forward(&mut prepared, &splats, &[], &params).unwrap();
    let bad = UpstreamGrads { v_alpha: vec![0.0; 3], ..UpstreamGrads::default() };
    let error = raster.backward(&mut prepared, &splats, &[], &params, &bad).unwrap_err();
    assert!(error.to_string().contains("`v_alpha` has 3 values, expected 256"), "{error}");
    let error =
        raster.backward(&mut prepared, &splats, &[1.0; 10], &params, &upstream).unwrap_err();
    assert!(matches!(error, RasterError::NoForward), "other channels: {error}");
    let mut broken = splats.clone();
    broken.quats.pop();
    assert!(raster.prepare(&broken, &camera(16, 16)).is_err(), "inconsistent array lengths");
    let mut blind = camera(16, 16);
    blind.intrinsics.fx = 0.0;
    assert!(raster.prepare(&splats, &blind).is_err(), "invalid camera");
}

#[test]
fn states_of_a_different_device_are_refused_or_replaced() {
    let (one, other) = (raster(Mode::Portable), raster(Mode::Native));
    let splats = cloud(16, 10, 1, -2.0);
    let params = RenderParams::default();
    let mut prepared = one.prepare(&splats, &camera(16, 16)).unwrap();
    let error = other.forward(&mut prepared, &splats, &[], &params).unwrap_err();
    assert!(error.to_string().contains("belongs to a different device"), "{error}");
    other.prepare_into(&splats, &camera(16, 16), &mut prepared).unwrap();
    assert!(other.forward(&mut prepared, &splats, &[], &params).is_ok(), "replaced");
}

/// Insufficient memory for the image or the lists is an error with the size; the same state is
/// usable afterwards.
#[test]
fn too_little_memory_is_an_error() {
    let mut options = GpuOptions::default();
    options.portable = true;
    options.max_binding_bytes = Some(64 << 10);
    let raster = WgpuRasterizer::new(GpuContext::with_options(choice(), options).unwrap());
    let params = RenderParams::default();
    let splats = cloud(17, 10, 0, -2.0);
    let mut prepared = raster.prepare(&splats, &camera(400, 300)).unwrap();
    let error = raster.forward(&mut prepared, &splats, &[], &params).unwrap_err().to_string();
    assert!(error.contains("image needs") && error.contains("bytes"), "{error}");

    let mut large = cloud(18, 500, 0, 3.0);
    large.means.iter_mut().for_each(|mean| mean[2] += 3.0);
    raster.prepare_into(&large, &camera(60, 50), &mut prepared).unwrap();
    let error = raster.forward(&mut prepared, &large, &[], &params);
    raster.prepare_into(&splats, &camera(60, 50), &mut prepared).unwrap();
    let small = raster.forward(&mut prepared, &splats, &[], &params).unwrap();
    assert!(small.alpha.iter().any(|&a| a > 0.0), "a smaller scene works in the same state");
    assert!(error.is_ok(), "16 tiles × 500 splats just fit: {error:?}");

    let mut many = cloud(19, 1000, 0, 4.0);
    many.means.iter_mut().for_each(|mean| mean[2] += 3.0);
    raster.prepare_into(&many, &camera(60, 50), &mut prepared).unwrap();
    let error = raster.forward(&mut prepared, &many, &[], &params).unwrap_err().to_string();
    assert!(error.contains("(splat, tile) pairs"), "{error}");

    // A preparation whose error is ignored does not give a wrong image later.
    let huge = camera(4000, 4000);
    assert!(raster.prepare_into(&splats, &huge, &mut prepared).is_err(), "too many tiles");
    assert!(raster.forward(&mut prepared, &splats, &[], &params).is_err(), "no splats");
    raster.prepare_into(&splats, &camera(60, 50), &mut prepared).unwrap();
    let again = raster.forward(&mut prepared, &splats, &[], &params).unwrap();
    assert_eq!(again, small, "the same state works again");
}

#[test]
fn a_missing_adapter_is_an_error_that_lists_adapters() {
    let error = GpuContext::new(AdapterChoice::Index(999)).unwrap_err().to_string();
    assert!(error.contains("999 does not exist"), "{error}");
    let listed = GpuContext::adapters();
    assert!(!listed.is_empty(), "the adapter of these tests is listed");
    assert!(
        listed.iter().all(|adapter| !adapter.name.is_empty() && adapter.max_binding_bytes > 0),
        "{listed:?}"
    );
}
