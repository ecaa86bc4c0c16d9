//! Both solvers on one problem: descent, restart, threads, memory; and rejected options.

use crate::common::{Case, Flaws, case, render};
use cuar::{
    AdamParams, CuarError, NoRefineObserver, Preview, RefineObserver, RefineOptions,
    RefineProgress, Refined, RegressionParams, Solver, State, ViewTime, Views, WarpForm, refine,
};
use gs_core::{DynamicScene, TimeRange, sh};
use gs_raster_cpu::CpuRasterizer;
use std::collections::BTreeMap;
use std::sync::OnceLock;

fn small() -> &'static Case {
    static CASE: OnceLock<Case> = OnceLock::new();
    let flaws = Flaws { interior: true, unseen_sh: 1.5, noise: 0.0 };
    CASE.get_or_init(|| case(3_000, 2, 4, (96, 72), flaws))
}

fn run(
    options: &RefineOptions,
    resume: Option<&State>,
    observer: &mut dyn RefineObserver,
) -> Result<Refined, CuarError> {
    let case = small();
    let times = TimeRange::UNIT.frames(16);
    let views = Views { cameras: &case.cameras, times: &times, held_out: &case.held_out };
    refine(&CpuRasterizer::default(), &case.scene, &case.edited, &views, options, resume, observer)
}

/// The solver with the objective only.
fn unaided(passes: usize) -> RefineOptions {
    let usual = RegressionParams::default();
    let solver =
        Solver::Regression(RegressionParams { passes, anchor_weight: 0.0, prior: 0.0, ..usual });
    RefineOptions { samples: 20, solver, ..RefineOptions::default() }
}

fn regression(passes: usize) -> RefineOptions {
    let solver = Solver::Regression(RegressionParams { passes, ..RegressionParams::default() });
    RefineOptions { samples: 20, solver, ..RefineOptions::default() }
}

fn adam(steps: usize) -> RefineOptions {
    let solver = Solver::Adam(AdamParams { steps, ..AdamParams::default() });
    RefineOptions { samples: 20, solver, ..RefineOptions::default() }
}

#[test]
fn regression_needs_fewer_evaluations_than_adam() {
    let fast = run(&unaided(6), None, &mut NoRefineObserver).unwrap().report;
    let evaluations = 6 * fast.samples.len();
    let slow = run(&adam(evaluations), None, &mut NoRefineObserver).unwrap().report;
    assert_eq!(fast.loss_before, slow.loss_before, "the same problem");
    assert!(slow.loss_after < slow.loss_before, "Adam descends: {slow:?}");
    let gain = |loss: f64| fast.loss_before - loss;
    assert!(gain(fast.loss_after) > 2.0 * gain(slow.loss_after), "{fast:?} {slow:?}");
}

/// Stores every checkpoint; cancels after a number of progress reports.
#[derive(Default)]
struct Keeper {
    states: Vec<State>,
    left: Option<usize>,
    previews: usize,
    last: Option<RefineProgress>,
}

impl RefineObserver for Keeper {
    fn progress(&mut self, progress: &RefineProgress) {
        assert!(progress.done <= progress.total, "{progress:?}");
        if progress.stage == "refine" {
            self.left = self.left.map(|left| left.saturating_sub(1));
        }
        self.last = Some(*progress);
    }
    fn preview(&mut self, preview: &Preview) {
        assert_eq!(preview.now.data.len(), preview.before.data.len(), "same size");
        self.previews += 1;
    }
    fn checkpoint(&mut self, state: &State) {
        self.states.push(state.clone());
    }
    fn cancelled(&mut self) -> bool {
        self.left == Some(0)
    }
}

/// Stores images, and counts those that are made.
#[derive(Default)]
struct Shelf {
    images: BTreeMap<(usize, u32), Vec<u8>>,
    made: usize,
    fingerprint: u64,
}

impl RefineObserver for Shelf {
    fn begin_images(&mut self, fingerprint: u64) {
        self.fingerprint = fingerprint;
    }
    fn stored_image(&mut self, at: ViewTime) -> Option<Vec<u8>> {
        self.images.get(&(at.view, at.time.to_bits())).cloned()
    }
    fn store_image(&mut self, at: ViewTime, bytes: &[u8]) {
        self.made += 1;
        self.images.insert((at.view, at.time.to_bits()), bytes.to_vec());
    }
}

#[test]
fn stored_images_are_not_made_again() {
    let options = regression(2);
    let mut shelf = Shelf::default();
    let whole = run(&options, None, &mut shelf).unwrap();
    let (made, fingerprint) = (shelf.made, shelf.fingerprint);
    assert!(made > 10, "{made} images");
    // As if killed while making images; one of them was damaged afterwards.
    while shelf.images.len() > made / 2 {
        shelf.images.pop_last();
    }
    let lost = made - shelf.images.len();
    shelf.images.first_entry().expect("an image").get_mut().push(0);
    shelf.made = 0;
    let again = run(&options, None, &mut shelf).unwrap();
    assert_eq!(shelf.made, lost + 1, "the missing and the damaged ones are made");
    assert_eq!((again.d_sh, again.sh), (whole.d_sh, whole.sh), "the same bits");
    assert_eq!(again.report.loss_after, whole.report.loss_after, "and losses");
    assert_eq!(again.report.held_out_after, whole.report.held_out_after, "and losses");
    assert_eq!(shelf.fingerprint, fingerprint, "the same inputs");
    run(&RefineOptions { epsilon: 0.7, ..options }, None, &mut shelf).unwrap();
    assert_ne!(shelf.fingerprint, fingerprint, "other inputs");
}

#[test]
fn interrupted_runs_resume_bit_identical() {
    for options in [regression(3), adam(70)] {
        let mut keeper = Keeper::default();
        let often = RefineOptions { checkpoint_secs: Some(0.0), ..options.clone() };
        let whole = run(&often, None, &mut keeper).unwrap();
        let count = keeper.states.len();
        assert!(count > 6, "{count} checkpoints: within passes, too");
        // as if killed directly after each of these, anywhere in a pass
        for state in keeper.states.iter().step_by(1 + count / 7).chain(keeper.states.last()) {
            let rest = run(&options, Some(state), &mut NoRefineObserver).unwrap();
            assert_eq!(rest.d_sh, whole.d_sh, "resumed at step {}", state.step);
            assert_eq!(rest.report.loss_after, whole.report.loss_after, "same losses");
            assert_eq!(rest.report.loss_before, whole.report.loss_before, "same losses");
        }

        let mut keeper = Keeper { left: Some(2), ..Keeper::default() };
        let cut = run(&options, None, &mut keeper);
        assert!(matches!(cut, Err(CuarError::Cancelled { .. })), "cancelled");
        let state = keeper.states.last().expect("a checkpoint before cancelling");
        let rest = run(&options, Some(state), &mut NoRefineObserver).unwrap();
        assert_eq!(rest.d_sh, whole.d_sh, "resumed at step {}", state.step);

        let mut other = options.clone();
        other.seed = 1;
        let refused = run(&other, Some(state), &mut NoRefineObserver);
        assert!(matches!(refused, Err(CuarError::State { .. })), "a different run's state");
        let mut damaged = state.clone();
        damaged.arrays[0].1.pop();
        assert!(run(&options, Some(&damaged), &mut NoRefineObserver).is_err(), "damaged state");
    }
}

#[test]
fn results_do_not_depend_on_threads_or_memory() {
    let options = regression(2);
    let on = |threads: usize, options: &RefineOptions| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(options, None, &mut NoRefineObserver).unwrap())
    };
    let one = on(1, &options);
    assert_eq!(one.d_sh, on(3, &options).d_sh, "threads");
    let kept = one.report.num_cached;
    assert_eq!(kept, one.report.samples.len(), "everything fits");
    // enough for the images but not for their prepared states
    let tight = RefineOptions { memory: one.report.bytes / 3, ..options };
    let tight = on(2, &tight);
    assert!(tight.report.num_cached < kept, "{} kept", tight.report.num_cached);
    assert_eq!(tight.report.samples, one.report.samples, "the images fit");
    assert_eq!(one.d_sh, tight.d_sh, "memory");
}

#[test]
fn observers_receive_progress_previews_and_checkpoints() {
    let options =
        RefineOptions { preview_secs: Some(0.0), checkpoint_secs: Some(0.0), ..regression(2) };
    let mut keeper = Keeper::default();
    run(&options, None, &mut keeper).unwrap();
    assert!(keeper.previews > 5, "{} previews", keeper.previews);
    assert!(keeper.states.len() > 5, "{} checkpoints", keeper.states.len());
    let last = keeper.last.unwrap();
    assert_eq!((last.stage, last.done), ("report", last.total), "{last:?}");
}

/// Compares every preview with a render of the whole scene with the colours of the previous step.
struct Oracle {
    d_sh: Vec<f32>,
    compared: usize,
    worst: f32,
}

impl RefineObserver for Oracle {
    fn preview(&mut self, preview: &Preview) {
        let case = small();
        let mut scene = case.scene.clone();
        let coeffs = sh::num_coeffs(scene.sh_degree());
        let rows = (0..case.edited.len()).filter(|&i| case.edited[i]);
        for (row, d_sh) in rows.zip(self.d_sh.chunks_exact(coeffs * 3)) {
            let own = scene.sh[row * coeffs..(row + 1) * coeffs].as_flattened_mut();
            own.iter_mut().zip(d_sh).for_each(|(value, change)| *value += change);
        }
        let whole = render(&scene, preview.time, &case.cameras[preview.view]);
        for y in 0..preview.now.height {
            for x in 0..preview.now.width {
                let there = whole.pixel(x + preview.origin[0], y + preview.origin[1]);
                for (a, b) in preview.now.pixel(x, y).iter().zip(there) {
                    self.worst = self.worst.max((a - b).abs());
                }
            }
        }
        self.compared += 1;
    }
    fn checkpoint(&mut self, state: &State) {
        self.d_sh.clone_from(&state.arrays[0].1);
    }
}

/// The image of the needed splats equals the image of the whole scene.
#[test]
fn omitting_splats_without_influence_changes_no_image() {
    let options = RefineOptions { preview_secs: Some(0.0), checkpoint_secs: Some(0.0), ..adam(60) };
    let mut oracle = Oracle { d_sh: Vec::new(), compared: 0, worst: 0.0 };
    run(&options, None, &mut oracle).unwrap();
    assert!(oracle.compared == 60, "{} images compared", oracle.compared);
    // worst seen 5.4e-7
    assert!(oracle.worst < 1.5e-6, "differs by {}", oracle.worst);
}

#[test]
fn the_paper_warp_lowers_the_loss() {
    let options = RefineOptions { warp: WarpForm::Paper, ..regression(2) };
    let report = run(&options, None, &mut NoRefineObserver).unwrap().report;
    assert!(report.loss_after < report.loss_before, "{report:?}");
}

#[test]
fn no_edited_rows_and_invalid_options() {
    let case = small();
    let times = TimeRange::UNIT.frames(4);
    let views = Views { cameras: &case.cameras, times: &times, held_out: &[] };
    let raster = CpuRasterizer::default();
    let go = |edited: &[bool], options: &RefineOptions| {
        refine(&raster, &case.scene, edited, &views, options, None, &mut NoRefineObserver)
    };
    let none = go(&vec![false; case.edited.len()], &RefineOptions::default()).unwrap();
    assert!(none.rows.is_empty() && none.sh.is_empty(), "nothing to do");
    assert!(go(&[true; 3], &RefineOptions::default()).is_err(), "the rows of a different scene");
    for broken in [
        RefineOptions { epsilon: f32::NAN, ..RefineOptions::default() },
        RefineOptions { samples: 0, ..RefineOptions::default() },
        RefineOptions { edit_time: Some(7.0), ..RefineOptions::default() },
        RefineOptions { background: [2.0; 3], ..RefineOptions::default() },
    ] {
        assert!(go(&case.edited, &broken).is_err(), "{broken:?}");
    }
}
