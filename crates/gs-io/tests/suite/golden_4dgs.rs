//! 4DGaussians model folders, read and evaluated, match the reference implementation: every flag
//! combination of the goldens, final parameters and intermediate values, within the tolerances of
//! `fixtures/deform4dgs/README.md`.

use gs_core::{DynamicScene, Splats};
use gs_deform::{Component, HexPlaneScene, Trace};
use gs_io::checkpoint4dgs;
use gs_io::model_folder::{ModelScene, Overrides};
use test_support::compare::{assert_close, widen};
use test_support::fixture;
use test_support::golden::Golden;

/// Tolerances of the README: absolute, and for scales relative (for log-scales absolute).
const VALUES: f64 = 1.5e-6;
const SCALES: f64 = 3e-6;

const VARIANTS: [&str; 7] = [
    "default_flags",
    "no_dx_no_ds",
    "no_dr_with_do_dshs",
    "apply_rotation",
    "grid_pe",
    "static_mlp_all_heads",
    "empty_voxel_all_heads",
];

fn open(case: &str) -> (HexPlaneScene, Golden) {
    let dir = fixture("deform4dgs").join(case);
    let model = checkpoint4dgs::open(&dir.join("model"), &Overrides::default()).unwrap();
    assert_eq!(model.report.repair.damaged(), 0, "{case}: no damaged rows");
    let ModelScene::Deformed(scene) = model.scene else { panic!("{case}: has a network") };
    (*scene, Golden::open(dir.join("expected.safetensors")))
}

/// Rows of slice `t` of a `[T, K, D]` tensor.
fn slice(values: &[f32], times: usize, t: usize) -> Vec<f64> {
    let length = values.len() / times;
    widen(&values[t * length..(t + 1) * length])
}

fn check_final(case: &str, golden: &Golden, splats: &Splats, t: usize) {
    let times = golden.f32s("times").len();
    let expected = |name: &str| slice(&golden.f32s(name), times, t);
    let n = splats.len();
    let scales: Vec<f64> = (0..n).flat_map(|i| splats.scale(i)).map(f64::from).collect();
    let rotations: Vec<f64> = (0..n).flat_map(|i| splats.rotation(i)).map(f64::from).collect();
    let opacity: Vec<f64> = (0..n).map(|i| f64::from(splats.opacity(i))).collect();
    let what = |name: &str| format!("{case}, time {t}: {name}");
    let close = |name: &str, actual: &[f64]| {
        assert_close(&what(name), actual, &expected(name), VALUES, 0.0);
    };
    close("means", &widen(splats.means.as_flattened()));
    assert_close(&what("scales"), &scales, &expected("scales"), 0.0, SCALES);
    close("rotations", &rotations);
    close("rotations_raw", &widen(splats.quats.as_flattened()));
    close("opacity", &opacity);
    if golden.has("log_scales") {
        let log_scales = widen(splats.log_scales.as_flattened());
        assert_close(&what("log_scales"), &log_scales, &expected("log_scales"), SCALES, 0.0);
        close("opacity_logit", &widen(&splats.opacity_logits));
    }
    if !golden.has("sh") {
        return; // The variants record SH only if they are deformed.
    }
    let sh_times = golden.shape("sh")[0];
    let sh_ids = golden.has("sh_ids").then(|| golden.i32s("sh_ids"));
    let sh: Vec<f64> = match &sh_ids {
        Some(ids) => ids
            .iter()
            .flat_map(|&id| splats.sh_of(usize::try_from(id).unwrap()).to_vec())
            .flat_map(|rgb| rgb.map(f64::from))
            .collect(),
        None => widen(splats.sh.as_flattened()),
    };
    let expected_sh = slice(&golden.f32s("sh"), sh_times, t.min(sh_times - 1));
    assert_close(&what("sh"), &sh, &expected_sh, VALUES, 0.0);
}

/// Sums over all points detect errors in rows that are not recorded.
fn check_sums(case: &str, golden: &Golden, splats: &Splats, t: usize) {
    let sums = golden.f64s("allpoint_sums.means");
    for axis in 0..3 {
        let column = splats.means.iter().map(|mean| f64::from(mean[axis]));
        let found = [column.clone().sum::<f64>(), column.map(|x| x * x).sum()];
        let expected = [sums[t * 6 + axis], sums[t * 6 + 3 + axis]];
        let n = splats.len() as f64;
        assert_close(&format!("{case}, time {t}: sums"), &found, &expected, n * VALUES, 0.0);
    }
}

fn probe_means(golden: &Golden, canonical: &Splats) -> Vec<[f32; 3]> {
    if !golden.has("probe_ids") {
        return canonical.means.clone();
    }
    let ids = golden.i32s("probe_ids");
    ids.iter().map(|&id| canonical.means[usize::try_from(id).unwrap()]).collect()
}

fn check_probes(case: &str, golden: &Golden, trace: &Trace, t: usize) {
    let times = golden.f32s("times").len();
    let close = |name: &str, actual: &[f32]| {
        let expected = slice(&golden.f32s(&format!("probe.{name}")), times, t);
        let what = format!("{case}, time {t}: probe {name}");
        assert_close(&what, &widen(actual), &expected, VALUES, 0.0);
    };
    close("coords", trace.coords.as_flattened());
    close("hexplane", &trace.features);
    close("hidden", &trace.hidden);
    assert_eq!(golden.has("probe.mask"), trace.mask.is_some(), "{case}: has a mask");
    if let Some(mask) = &trace.mask {
        close("mask", mask);
    }
    let names = ["dx", "ds", "dr", "do", "dshs"];
    for (component, name) in Component::ALL.into_iter().zip(names) {
        let head = &trace.heads[component as usize];
        if !golden.has("probe_ids") {
            continue; // The variants record no raw head outputs.
        }
        assert_eq!(golden.has(&format!("probe.{name}")), head.is_some(), "{case}: head {name}");
        if let Some(values) = head {
            close(name, values);
        }
    }
}

fn check_planes(case: &str, golden: &Golden, scene: &HexPlaneScene, trace: &Trace, t: usize) {
    if !golden.has("probe.planes") {
        return;
    }
    let planes = scene.field().planes();
    let shape = golden.shape("probe.planes");
    let expected = slice(&golden.f32s("probe.planes"), shape[0], t);
    let found: Vec<f32> = trace.coords[..shape[1]]
        .iter()
        .flat_map(|coords| {
            (0..planes.levels.len())
                .flat_map(move |level| (0..6).flat_map(move |p| planes.sample(level, p, *coords)))
        })
        .collect();
    let what = format!("{case}, time {t}: planes");
    assert_close(&what, &widen(&found), &expected, VALUES, 0.0);
}

fn check(case: &str) {
    let (scene, golden) = open(case);
    let mut splats = Splats::default();
    for (t, &time) in golden.f32s("times").iter().enumerate() {
        // The field clamps times outside the sequence; the scene refuses them.
        scene.field().deform_into(scene.canonical(), time, &mut splats).unwrap();
        check_final(case, &golden, &splats, t);
        let trace = scene.field().trace(&probe_means(&golden, scene.canonical()), time);
        check_probes(case, &golden, &trace, t);
        check_planes(case, &golden, &scene, &trace, t);
        if golden.has("allpoint_sums.means") {
            check_sums(case, &golden, &splats, t);
        }
        if scene.time_range().contains(time) {
            let through_scene = scene.at(time).unwrap();
            check_final(case, &golden, &through_scene, t);
            let mut geometry = Splats::default();
            scene.geometry_into(time, &mut geometry).unwrap();
            assert_eq!(geometry.means, through_scene.means, "{case}: geometry alone, means");
            assert_eq!(geometry.quats, through_scene.quats, "{case}: geometry alone, quats");
            assert_eq!(geometry.log_scales, through_scene.log_scales, "{case}: scales");
            assert!(geometry.sh.is_empty(), "{case}: geometry alone leaves SH");
        } else {
            assert!(scene.at(time).is_err(), "{case}: {time} is outside");
        }
    }
}

#[test]
fn dnerf_like() {
    check("dnerf_like");
}

#[test]
fn dynerf_like() {
    check("dynerf_like");
}

#[test]
fn every_flag_combination() {
    for variant in VARIANTS {
        check(&format!("variants/{variant}"));
    }
}

/// Negative control: the mistakes listed in the README exceed the tolerance by far.
#[test]
fn wrong_flags_exceed_the_tolerances() {
    let dir = fixture("deform4dgs/dynerf_like");
    let golden = Golden::open(dir.join("expected.safetensors"));
    let times = golden.f32s("times");
    let wrong = [
        Overrides { no_do: Some(true), ..Overrides::default() },
        Overrides { no_dshs: Some(true), ..Overrides::default() },
        Overrides { no_dx: Some(true), ..Overrides::default() },
        Overrides { apply_rotation: Some(true), ..Overrides::default() },
    ];
    for overrides in wrong {
        let model = checkpoint4dgs::open(&dir.join("model"), &overrides).unwrap();
        let splats = model.scene.at(times[1]).unwrap();
        let caught = std::panic::catch_unwind(|| {
            check_final("wrong flag", &golden, &splats, 1);
        });
        assert!(caught.is_err(), "{overrides:?} is not detected");
    }
}

/// The per-frame export of the reference contains the deformed parameters but the stored opacity.
#[test]
fn per_frame_export_agrees() {
    let dir = fixture("deform4dgs/variants/static_mlp_all_heads");
    let (scene, golden) = open("variants/static_mlp_all_heads");
    for (t, &time) in golden.f32s("times").iter().enumerate() {
        let path = dir.join(format!("gaussian_pertimestamp/time_{t:05}.ply"));
        let exported = gs_io::ply::read_file(&path).unwrap().splats;
        let mut splats = Splats::default();
        scene.field().deform_into(scene.canonical(), time, &mut splats).unwrap();
        let close = |what: &str, a: &[f32], b: &[f32]| {
            assert_close(what, &widen(a), &widen(b), VALUES, SCALES);
        };
        close("means", splats.means.as_flattened(), exported.means.as_flattened());
        close("quats", splats.quats.as_flattened(), exported.quats.as_flattened());
        close("scales", splats.log_scales.as_flattened(), exported.log_scales.as_flattened());
        close("sh", splats.sh.as_flattened(), exported.sh.as_flattened());
        assert_eq!(exported.opacity_logits, scene.canonical().opacity_logits, "stored opacity");
    }
}

#[test]
fn results_do_not_depend_on_threads_or_cache() {
    let (scene, _) = open("dynerf_like");
    let expected = scene.at(0.37).unwrap();
    let (uncached, _) = open("dynerf_like");
    let uncached = uncached.with_cache_limit(0);
    assert_eq!(uncached.at(0.37).unwrap(), expected, "without the cache");
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| scene.at(0.37).unwrap()), expected, "{threads} threads");
    }
}
