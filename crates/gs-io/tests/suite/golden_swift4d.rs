//! A Swift4D model folder, read and evaluated, matches `fixtures/swift4d` within the tolerances of
//! its README: masks, lattice, intermediate values and deformed Gaussians at six times.

use gs_core::{DynamicScene, Splats};
use gs_deform::HashGridScene;
use gs_io::model_folder::{ModelScene, Overrides};
use gs_io::swift4d;
use std::path::PathBuf;
use test_support::compare::{assert_close, widen};
use test_support::fixture;
use test_support::golden::Golden;

const TIMES: [(f32, &str); 6] =
    [(0.0, "0.00"), (0.1, "0.10"), (0.25, "0.25"), (0.5, "0.50"), (0.7, "0.70"), (1.0, "1.00")];
/// Absolute tolerances of the README.
const VALUES: f64 = 1.5e-6;
const ROTATIONS: f64 = 4e-6;
const SCALES: f64 = 1e-7;

fn expected(name: &str) -> Golden {
    Golden::open(fixture("swift4d/expected").join(format!("{name}.safetensors")))
}

fn open(overrides: &Overrides) -> HashGridScene {
    let model = swift4d::open(&fixture("swift4d/model"), overrides).unwrap();
    assert!(model.report.warnings.is_empty(), "{:?}", model.report.warnings);
    let ModelScene::HashGrid(scene) = model.scene else { panic!("has a hash grid") };
    *scene
}

fn masks(name: &str) -> Vec<bool> {
    expected("masks").u8s(name).into_iter().map(|flag| flag != 0).collect()
}

/// Compares the Gaussians listed in the golden: all, or the moving ones.
fn check(what: &str, splats: &Splats, golden: &Golden) {
    let rows: Vec<usize> = if golden.shape("means")[0] == splats.len() {
        (0..splats.len()).collect()
    } else {
        moving()
    };
    let flat = |values: Vec<f64>, name: &str, tolerance: f64| {
        assert_close(&format!("{what}: {name}"), &values, &golden.f64s(name), tolerance, 0.0);
    };
    let each = |row: &dyn Fn(usize) -> Vec<f32>| -> Vec<f64> {
        rows.iter().flat_map(|&i| row(i)).map(f64::from).collect()
    };
    flat(each(&|i| splats.means[i].to_vec()), "means", VALUES);
    flat(each(&|i| splats.scale(i).to_vec()), "scales", SCALES);
    flat(each(&|i| splats.rotation(i).to_vec()), "rotations", ROTATIONS);
    flat(each(&|i| vec![splats.opacity(i)]), "opacities", VALUES);
    if golden.has("shs_deformed") {
        let sh = moving().into_iter().flat_map(|i| splats.sh_of(i).as_flattened().to_vec());
        flat(sh.map(f64::from).collect(), "shs_deformed", VALUES);
    }
}

fn moving() -> Vec<usize> {
    let deformed = masks("deformed");
    (0..deformed.len()).filter(|&row| deformed[row]).collect()
}

fn at(scene: &HashGridScene, t: f32) -> Splats {
    let mut out = Splats::default();
    scene.deform_into(t, &mut out).unwrap();
    out
}

#[test]
fn deformed_gaussians_at_six_times() {
    let scene = open(&Overrides::default());
    let (mut geometry, mut reused) = (Splats::default(), Splats::default());
    for (t, name) in TIMES {
        let splats = at(&scene, t);
        check(&format!("time {name}"), &splats, &expected(&format!("expected_t{name}")));
        scene.deform_into(t, &mut reused).unwrap();
        assert_eq!(reused, splats, "memory of a different time can be reused");
        if scene.time_range().contains(t) {
            assert_eq!(scene.at(t).unwrap(), splats, "through the trait");
            scene.geometry_into(t, &mut geometry).unwrap();
            assert_eq!(geometry.means, splats.means, "geometry alone: means");
            assert_eq!(geometry.quats, splats.quats, "geometry alone: quats");
            assert_eq!(geometry.log_scales, splats.log_scales, "geometry alone: scales");
            assert!(geometry.sh.is_empty(), "geometry alone leaves SH");
        }
    }
}

#[test]
fn static_gaussians_are_unchanged_bit_for_bit() {
    let scene = open(&Overrides::default());
    let deformed = masks("deformed");
    let still: Vec<usize> = (0..deformed.len()).filter(|&row| !deformed[row]).collect();
    let stored = scene.canonical().select(&still);
    assert_eq!(at(&scene, 0.7).select(&still), stored, "static, or outside the box");
}

#[test]
fn masks_and_box() {
    let scene = open(&Overrides::default());
    assert_eq!(scene.dynamic_mask().unwrap(), masks("dynamic"), "scores above 7, strictly");
    let rows: Vec<usize> = scene.moving_rows().iter().map(|&row| row as usize).collect();
    assert_eq!(rows, moving(), "dynamic and inside");
    let coords: Vec<_> =
        scene.canonical().means.iter().map(|m| scene.field().bounds().normalize(*m)).collect();
    let inside: Vec<bool> = coords.iter().map(Option::is_some).collect();
    assert_eq!(inside, masks("inside_box"), "faces belong to the box");
    let golden = expected("masks").f32s("normalised_xyz");
    for (coords, expected) in coords.iter().zip(golden.as_chunks::<3>().0) {
        assert!(coords.is_none_or(|coords| coords == *expected), "{coords:?} {expected:?}");
    }
}

#[test]
fn intermediate_values() {
    let scene = open(&Overrides::default());
    let golden = expected("intermediates");
    let gaussians = golden.i32s("gaussian");
    for (t, name) in [(0.25, "t0.25"), (1.0, "t1.00")] {
        let inputs: Vec<[f32; 4]> = gaussians
            .iter()
            .map(|&row| {
                let mean = scene.canonical().means[usize::try_from(row).unwrap()];
                let [x, y, z] = scene.field().bounds().normalize(mean).unwrap();
                [x, y, z, t]
            })
            .collect();
        assert_eq!(inputs.as_flattened(), golden.f32s(&format!("{name}.input")), "{name}: input");
        let (mut fractions, mut indices) = (Vec::new(), Vec::new());
        for input in &inputs {
            for level in scene.field().grid().levels() {
                let located = input.map(|x| level.locate(x));
                fractions.extend(located.map(|(_, fraction)| fraction));
                for k in 0..16_u32 {
                    let corner = std::array::from_fn(|d| located[d].0 + (k >> d & 1));
                    indices.push(i32::try_from(level.index(corner)).unwrap());
                }
            }
        }
        assert_eq!(fractions, golden.f32s(&format!("{name}.frac")), "{name}: fractions");
        assert_eq!(indices, golden.i32s(&format!("{name}.index")), "{name}: indices");
        let trace = scene.field().trace(&inputs);
        let close = |part: &str, found: &[f32]| {
            let what = format!("{name}.{part}");
            assert_close(&what, &widen(found), &golden.f64s(&what), VALUES, 0.0);
        };
        close("encoding", &trace.features);
        close("hidden", &trace.hidden);
        let heads = ["xyz", "scales", "rotations", "opacity", "shs"];
        for (head, values) in heads.into_iter().zip(&trace.heads) {
            close(&format!("{head}_deform"), values.as_ref().unwrap());
        }
    }
}

/// Negative controls: parameters left unrounded, and each flag set wrong, exceed the tolerances.
#[test]
fn unrounded_parameters_and_wrong_flags_exceed_the_tolerances() {
    let fails = |what: &str, splats: &Splats, golden: &Golden| {
        let caught = std::panic::catch_unwind(|| check("wrong", splats, golden));
        assert!(caught.is_err(), "{what} is not detected");
    };
    let golden = expected("expected_t0.25");
    let right = at(&open(&Overrides::default()), 0.25);
    fails("missing rounding to half precision", &right, &expected("unrounded_params_t0.25"));
    let mut wrong = Overrides::default();
    wrong.swift4d.trunk_relu = Some(false);
    fails("trunk without ReLU", &at(&open(&wrong), 0.25), &golden);
    let mut wrong = Overrides::default();
    wrong.swift4d.dynamic_thro = Some(7.0_f32.next_down());
    fails("threshold an ulp lower", &at(&open(&wrong), 0.25), &golden);
    // The older index rule agrees for such a small table.
    let mut older = Overrides::default();
    older.swift4d.index_rule = Some(gs_deform::IndexRule::Older);
    check("older rule", &at(&open(&older), 0.25), &golden);
}

#[test]
fn results_do_not_depend_on_threads() {
    let scene = open(&Overrides::default());
    let expected = scene.at(0.37).unwrap();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| scene.at(0.37).unwrap()), expected, "{threads} threads");
    }
}

#[test]
fn an_iteration_folder_can_be_opened() {
    let path: PathBuf = fixture("swift4d/model/point_cloud/iteration_13000");
    let model = swift4d::open(&path, &Overrides::default()).unwrap();
    assert_eq!(model.report.iteration, 13_000, "path of the iteration's folder");
    assert_eq!(model.report.white_background, Some(true), "its cfg_args is found");
}
