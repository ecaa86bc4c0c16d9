//! A refinement on the device equals the one on the host: step by step, resumed, with images that
//! do not fit and offsets larger than a binding; and the default solver gives the same result with
//! both rasterisers.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[path = "../../cuar/tests/suite/common/mod.rs"]
mod cases;
#[path = "../../gs-raster-wgpu/tests/common/mod.rs"]
mod common;

use cases::{Case, Flaws, case};
use common::{Mode, choice, cloud, noise, raster};
use cuar::loss::LossWeights;
use cuar::{
    AdamParams, Backend, Crop, CuarError, DescentEngine, DescentImage, DescentTask, Entry,
    NoRefineObserver, Preview, RefineObserver, RefineOptions, RefinePreset, Refined, Solver, State,
    Views, refine, refine_with,
};
use gs_core::{DynamicScene, Rasterizer, TimeRange};
use gs_raster_cpu::CpuRasterizer;
use gs_raster_wgpu::{GpuContext, GpuOptions, WgpuRasterizer};
use gs_train_wgpu::DeviceDescent;
use std::sync::OnceLock;

const STEPS: usize = 24;

fn small() -> &'static Case {
    static CASE: OnceLock<Case> = OnceLock::new();
    let flaws = Flaws { interior: true, unseen_sh: 1.5, noise: 0.0 };
    CASE.get_or_init(|| case(3_000, 2, 4, (96, 72), flaws))
}

/// The paper's preset, with fewer images and steps.
fn paper() -> RefineOptions {
    let solver = Solver::Adam(AdamParams { steps: STEPS, ..AdamParams::default() });
    let options = RefineOptions::preset(RefinePreset::Paper);
    RefineOptions { samples: 8, solver, checkpoint_secs: Some(0.0), ..options }
}

/// Stores every checkpoint and preview.
#[derive(Default)]
struct Keeper {
    states: Vec<State>,
    previews: Vec<Preview>,
}

impl RefineObserver for Keeper {
    fn preview(&mut self, preview: &Preview) {
        self.previews.push(preview.clone());
    }
    fn checkpoint(&mut self, state: &State) {
        self.states.push(state.clone());
    }
}

fn times() -> Vec<f32> {
    TimeRange::UNIT.frames(16)
}

fn views<'a>(case: &'a Case, times: &'a [f32]) -> Views<'a> {
    Views { cameras: &case.cameras, times, held_out: &case.held_out }
}

/// Refinement with steps on the host, with this rasteriser.
fn on_host<R: Rasterizer<Prepared: Send> + Sync>(
    raster: &R,
    options: &RefineOptions,
    resume: Option<&State>,
    observer: &mut dyn RefineObserver,
) -> Refined {
    let (case, times) = (small(), times());
    let views = views(case, &times);
    refine(raster, &case.scene, &case.edited, &views, options, resume, observer).unwrap()
}

/// Refinement with steps on the device; also returns the number of images kept there.
fn on_device(
    raster: &WgpuRasterizer,
    options: &RefineOptions,
    resume: Option<&State>,
    observer: &mut dyn RefineObserver,
) -> Result<(Refined, usize), CuarError> {
    let (case, times) = (small(), times());
    let mut engine = DeviceDescent::new(raster.clone())?;
    let backend = Backend { raster, descent: Some(&mut engine) };
    let views = views(case, &times);
    let refined =
        refine_with(backend, &case.scene, &case.edited, &views, options, resume, observer)?;
    Ok((refined, engine.num_kept()))
}

fn array<'a>(state: &'a State, name: &str) -> &'a [f32] {
    &state.arrays.iter().find(|(key, _)| key == name).unwrap().1
}

/// Mean absolute difference, relative to the mean absolute value.
fn deviation(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len(), "as many values");
    let sum = |values: &mut dyn Iterator<Item = f32>| values.map(f64::from).sum::<f64>();
    let apart = sum(&mut a.iter().zip(b).map(|(a, b)| (a - b).abs()));
    apart / sum(&mut b.iter().map(|b| b.abs())).max(1e-12)
}

fn assert_same_run(what: &str, got: &Keeper, expected: &Keeper) {
    assert_eq!(got.states.len(), STEPS, "{what}: a checkpoint per step");
    for (a, b) in got.states.iter().zip(&expected.states) {
        assert_eq!((a.step, a.fingerprint), (b.step, b.fingerprint), "{what}: the same run");
        // Adam depends on the sign of gradients that are almost zero, so a few values may differ.
        for (name, most) in [("d_sh", 5e-3), ("sh_m", 5e-3), ("sh_v", 5e-3)] {
            let apart = deviation(array(a, name), array(b, name));
            assert!(apart < most, "{what}, step {}: {name} differs by {apart}", a.step);
        }
    }
}

#[test]
fn steps_on_the_device_match_those_on_the_host() {
    let options = RefineOptions { preview_secs: Some(0.0), ..paper() };
    for mode in [Mode::Portable, Mode::Native] {
        let raster = raster(mode);
        let (mut there, mut here) = (Keeper::default(), Keeper::default());
        let (got, kept) = on_device(&raster, &options, None, &mut there).unwrap();
        let expected = on_host(&raster, &options, None, &mut here);
        assert_eq!(kept, 8, "{mode:?}: every image was uploaded once");
        assert_same_run(&format!("{mode:?}"), &there, &here);
        let first = expected.report.trace.first().unwrap();
        assert!(expected.report.trace.last().unwrap().loss < first.loss, "it descends");
        for (a, b) in got.report.trace.iter().zip(&expected.report.trace) {
            assert_eq!(a.step, b.step, "{mode:?}: points of the curve");
            assert!((a.loss - b.loss).abs() < 1e-4 * b.loss, "{mode:?}: {} {}", a.loss, b.loss);
        }
        assert_eq!(there.previews.len(), STEPS, "{mode:?}: previews");
        for (a, b) in there.previews.iter().zip(&here.previews) {
            assert_eq!((a.view, a.time, a.origin), (b.view, b.time, b.origin), "{mode:?}");
            let pairs = a.now.data.iter().zip(&b.now.data);
            let worst = pairs.fold(0.0_f32, |worst, (a, b)| worst.max((a - b).abs()));
            assert!(worst < 1e-3, "{mode:?}: a preview differs by {worst}");
        }
    }
}

/// Negative control: a different rate gives a different result.
#[test]
#[should_panic(expected = "d_sh differs")]
fn a_different_rate_is_detected() {
    let raster = raster(Mode::Portable);
    let (mut there, mut here) = (Keeper::default(), Keeper::default());
    on_device(&raster, &paper(), None, &mut there).unwrap();
    let params = AdamParams { steps: STEPS, rate_dc: 0.00255, ..AdamParams::default() };
    let solver = Solver::Adam(params);
    on_host(&raster, &RefineOptions { solver, ..paper() }, None, &mut here);
    for (state, other) in there.states.iter_mut().zip(&here.states) {
        state.fingerprint = other.fingerprint;
    }
    assert_same_run("control", &there, &here);
}

/// The whole stage, including images and masks, compared with the one on the host.
#[test]
fn the_paper_preset_matches_the_cpu() {
    let raster = raster(Mode::Native);
    let options = RefineOptions { checkpoint_secs: None, ..paper() };
    let (got, _) = on_device(&raster, &options, None, &mut NoRefineObserver).unwrap();
    let expected = on_host(&CpuRasterizer::default(), &options, None, &mut NoRefineObserver);
    assert_same_result(&got, &expected);
    let mut splats = small().scene.at(0.0).unwrap();
    let before = splats.clone();
    got.apply(&mut splats);
    let coeffs = splats.sh_coeffs();
    for row in (0..splats.len()).filter(|&row| !small().edited[row]) {
        let rows = row * coeffs..(row + 1) * coeffs;
        assert_eq!(splats.sh[rows.clone()], before.sh[rows], "unedited row {row} is unchanged");
    }
    assert_eq!(splats.means, before.means, "geometry is unchanged");
    let moved = |refined: &Refined| -> Vec<bool> {
        refined.d_sh.chunks(coeffs).map(|d| d.iter().any(|d| *d != [0.0; 3])).collect()
    };
    let (a, b) = (moved(&got), moved(&expected));
    let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count();
    assert!(differ * 100 <= a.len(), "{differ} of {} rows moved in one run only", a.len());
}

fn assert_same_result(got: &Refined, expected: &Refined) {
    let (a, b) = (&got.report, &expected.report);
    assert_eq!(got.rows, expected.rows, "the same rows");
    assert_eq!(a.samples, b.samples, "the same images");
    assert!(b.loss_after < b.loss_before, "{b:?}");
    let gain = b.loss_before - b.loss_after;
    for (what, a, b) in [
        ("before", a.loss_before, b.loss_before),
        ("after", a.loss_after, b.loss_after),
        ("held out, after", a.held_out_after, b.held_out_after),
    ] {
        assert!((a - b).abs() < 0.02 * b.min(gain), "loss {what}: {a} {b}, gain {gain}");
    }
    let apart = deviation(got.d_sh.as_flattened(), expected.d_sh.as_flattened());
    assert!(apart < 0.03, "offsets differ by {apart}");
}

/// The least-squares solver uses the trait: forward and colour-only backward passes on the device,
/// the rest on the host.
#[test]
fn the_default_solver_matches_the_cpu() {
    let options = RefineOptions { samples: 12, ..RefineOptions::default() };
    let expected = on_host(&CpuRasterizer::default(), &options, None, &mut NoRefineObserver);
    let (got, _) = on_device(&raster(Mode::Native), &options, None, &mut NoRefineObserver).unwrap();
    assert_same_result(&got, &expected);
}

#[test]
fn resumed_runs_are_bit_identical() {
    let raster = raster(Mode::Portable);
    let mut keeper = Keeper::default();
    let (whole, _) = on_device(&raster, &paper(), None, &mut keeper).unwrap();
    for step in [7, 16] {
        let state = &keeper.states[step - 1];
        assert_eq!(state.step, step as u64, "a checkpoint per step");
        let (rest, _) = on_device(&raster, &paper(), Some(state), &mut NoRefineObserver).unwrap();
        assert_eq!(rest.d_sh, whole.d_sh, "resumed at step {step}");
        assert_eq!(rest.report.loss_after, whole.report.loss_after, "the same loss");
    }
    // Each resumes from a checkpoint of the other.
    let state = &keeper.states[11];
    let rest = on_host(&raster, &paper(), Some(state), &mut NoRefineObserver);
    let apart = deviation(rest.d_sh.as_flattened(), whole.d_sh.as_flattened());
    assert!(apart < 5e-3, "resumed on the host: {apart}");
    let mut damaged = state.clone();
    damaged.arrays[0].1.pop();
    assert!(
        on_device(&raster, &paper(), Some(&damaged), &mut NoRefineObserver).is_err(),
        "damaged"
    );
}

/// Images that do not fit into memory are uploaded again; the result is bit-identical.
#[test]
fn a_small_memory_budget_does_not_change_the_result() {
    let options = RefineOptions { checkpoint_secs: None, ..paper() };
    let whole = raster(Mode::Portable);
    let (expected, _) = on_device(&whole, &options, None, &mut NoRefineObserver).unwrap();

    let bytes = expected.report.bytes;
    let tight = RefineOptions { memory: bytes / 3, ..options.clone() };
    let (got, kept) = on_device(&whole, &tight, None, &mut NoRefineObserver).unwrap();
    assert!(kept < 8 && got.report.num_cached < 8, "{kept} images kept");
    assert_eq!(got.report.samples, expected.report.samples, "the images fit the host");
    assert_eq!(got.d_sh, expected.d_sh, "images uploaded again");
}

/// Three steps from zero: offsets of `rows` rows of degree 3; the image shows every third row.
fn three_steps(raster: &WgpuRasterizer, rows: usize) -> (Vec<[f32; 3]>, cuar::Adam<f32>) {
    let camera = common::camera(48, 40);
    let splats = cloud(6, rows / 3, 0, -3.0);
    let crop = Crop { x: 3, y: 2, width: 40, height: 35 };
    let values = 3 * crop.width * crop.height;
    let [original, warp] = [1, 2]
        .map(|seed| noise(seed, values).into_iter().map(|n| 0.5 + 0.5 * n).collect::<Vec<f32>>());
    let flags: Vec<u8> = (0..values / 3).map(|p| [5, 6, 4, 0][p % 4]).collect();
    let eye = [0.3, 0.2, -4.0];
    let entry = |(row, mean): (u32, &[f32; 3])| {
        let ray = [0, 1, 2].map(|axis| mean[axis] - eye[axis]);
        let length = ray.iter().map(|x| x * x).sum::<f32>().sqrt();
        let towards = ray.map(|x| x / length);
        Entry { local: row, row: 3 * row, towards, color: [0.1, 0.5, 0.9], is_constrained: true }
    };
    let entries: Vec<Entry> = (0..).zip(&splats.means).map(entry).collect();
    let (original, warp, flags, entries) = (&original[..], &warp[..], &flags[..], &entries[..]);
    let image = DescentImage { index: 0, size: [48, 40], crop, original, warp, flags, entries };
    let mut d_sh = vec![[0.0; 3]; 16 * rows];
    let mut adam = cuar::Adam::new(48 * rows);
    let (rates, weights) = ([0.01; 48], LossWeights::default());
    let task = DescentTask { sh_degree: 3, rates: &rates, weights, memory: usize::MAX };
    let mut engine = DeviceDescent::new(raster.clone()).unwrap();
    engine.begin(&task, &d_sh, &adam).unwrap();
    let mut prepared = raster.prepare(&splats, &camera).unwrap();
    for _ in 0..3 {
        engine.step(&image, &mut prepared).unwrap();
    }
    assert_eq!(engine.losses().unwrap().len(), 3, "losses of three steps");
    engine.read(&mut d_sh, &mut adam).unwrap();
    let wrong = DescentImage { size: [40, 48], ..image };
    let refused = engine.step(&wrong, &mut prepared).unwrap_err().to_string();
    assert!(refused.contains("`width` has 40 values, expected 48"), "{refused}");
    (d_sh, adam)
}

/// Offsets, gradients and moments larger than a binding are split; the result is bit-identical.
/// Rows that are not visible stay zero.
#[test]
fn splitting_does_not_change_the_result() {
    let rows = 3_000;
    assert!(rows * 48 * 4 > 4 * (128 << 10), "five bindings");
    let mut gpu = GpuOptions::default();
    gpu.portable = true;
    gpu.max_binding_bytes = Some(128 << 10);
    let split = WgpuRasterizer::new(GpuContext::with_options(choice(), gpu).unwrap());
    let (d_sh, adam) = three_steps(&raster(Mode::Portable), rows);
    let in_pieces = three_steps(&split, rows);
    assert!((&d_sh, &adam) == (&in_pieces.0, &in_pieces.1), "the same bits");
    for (row, own) in d_sh.chunks(16).enumerate() {
        let moved = own.iter().flatten().any(|d| d.to_bits() != 0);
        assert!(!moved || row % 3 == 0, "row {row} is not visible");
    }
    let last = d_sh.chunks(16).skip(2_700).filter(|own| own[0] != [0.0; 3]).count();
    assert!(last > 20, "{last} of the last 100 visible rows changed");
}

/// Too little memory for data that cannot be split is an error.
#[test]
fn too_little_memory_is_an_error() {
    let mut gpu = GpuOptions::default();
    gpu.portable = true;
    gpu.max_binding_bytes = Some(16 << 10);
    let raster = WgpuRasterizer::new(GpuContext::with_options(choice(), gpu).unwrap());
    let error = on_device(&raster, &paper(), None, &mut NoRefineObserver).unwrap_err().to_string();
    assert!(error.contains("bytes, more than graphics adapter"), "{error}");
}
