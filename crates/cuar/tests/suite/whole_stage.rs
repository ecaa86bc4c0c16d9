//! Hidden splats, and view dependence that frame 1 does not determine, repaired in one run; and
//! interrupted runs.

use crate::common;
use crate::common::Painted;
use crate::common::delivered::{Delivered, Judge, cases, delivered, with_unseen_sh};
use cuar::{
    CuarError, NoRefineObserver, RefineObserver, RefineOptions, RefineProgress, Refined, State,
    Views,
};
use gs_core::TimeRange;
use std::sync::OnceLock;

/// A textured jacket delivered from eight frontal pictures, with SH that these do not determine.
fn both() -> &'static (Delivered, Painted) {
    static CASE: OnceLock<(Delivered, Painted)> = OnceLock::new();
    CASE.get_or_init(|| {
        let (name, edits) = cases().into_iter().find(|(name, _)| *name == "textured").unwrap();
        let case = delivered(name, &edits, 8_000, 3, |_| {
            let (mut cameras, held_out) = common::cameras(8, 160, 120);
            let held = held_out.iter().map(|&view| cameras[view].clone()).collect();
            cameras.truncate(8);
            (cameras, held)
        });
        let scene = with_unseen_sh(&case, 1.5);
        (case, scene)
    })
}

#[test]
fn both_kinds_of_flaws_are_corrected_in_one_run() {
    let (case, scene) = both();
    let judge = Judge::of(case, scene, &[0.2, 0.4, 0.6, 0.8]);
    let options = RefineOptions { samples: 80, ..RefineOptions::default() };
    let without = RefineOptions { evidence: None, ..options.clone() };
    let [both, alone] = [options, without].map(|options| case.refined(scene, 16, &options));
    let [then, now, view_alone] = [
        judge.score(scene).db(),
        judge.score(&both.scene(scene)).db(),
        judge.score(&alone.scene(scene)).db(),
    ];
    let shown = format!("{then:.2?} → {now:.2?}, without evidence {view_alone:.2?} dB");
    assert!(both.report.repair.recoloured > 20, "{:?}", both.report.repair);
    assert!(both.report.supervision.supervised() > 0, "{:?}", both.report.supervision);
    assert!(now[0] > then[0] + 2.0, "revealed {shown}");
    assert!(now[0] > view_alone[0] + 2.0, "revealed {shown}");
    assert!(now[2] > then[2] + 3.0, "in the paper's mask {shown}");
    assert!(now[1] > then[1] - 0.02 && now[3] > then[3] - 0.02, "elsewhere, outside {shown}");
}

/// Stores every checkpoint, and stops after some steps.
#[derive(Default)]
struct Interrupter {
    states: Vec<State>,
    left: Option<usize>,
}

impl RefineObserver for Interrupter {
    fn progress(&mut self, progress: &RefineProgress) {
        if progress.stage == "refine" {
            self.left = self.left.map(|left| left.saturating_sub(1));
        }
    }
    fn checkpoint(&mut self, state: &State) {
        self.states.push(state.clone());
    }
    fn cancelled(&mut self) -> bool {
        self.left == Some(0)
    }
}

#[test]
fn interrupted_repairs_resume_bit_identical_on_any_number_of_threads() {
    let (case, scene) = both();
    let options = RefineOptions { samples: 12, ..RefineOptions::default() };
    let times = TimeRange::UNIT.frames(6);
    let views = Views { cameras: &case.pictures, times: &times, held_out: &[3] };
    let run =
        |threads: usize, resume: Option<&State>, observer: &mut (dyn RefineObserver + Send)| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| case.refined_from(scene, &views, &options, resume, observer))
        };
    let result = |refined: Refined| (refined.rows, refined.sh, refined.d_sh, refined.faded);
    let whole = run(2, None, &mut NoRefineObserver).unwrap();
    assert!(whole.report.repair.recoloured > 20, "{:?}", whole.report.repair);
    let counts = whole.report.repair;
    let whole = result(whole);
    for (stopped_on, threads) in [(2, 1), (1, 7), (7, 2)] {
        let mut observer = Interrupter { left: Some(3), ..Interrupter::default() };
        let stopped = run(stopped_on, None, &mut observer);
        assert!(matches!(stopped, Err(CuarError::Cancelled { .. })), "stopped");
        let state = observer.states.last().expect("a checkpoint before the end");
        let rest = run(threads, Some(state), &mut NoRefineObserver).unwrap();
        assert_eq!(rest.report.repair, counts, "{threads} threads");
        assert_eq!(result(rest), whole, "stopped on {stopped_on} threads, resumed on {threads}");
    }
    let other = RefineOptions { evidence: None, ..options.clone() };
    let mut observer = Interrupter { left: Some(3), ..Interrupter::default() };
    assert!(run(2, None, &mut observer).is_err(), "stopped");
    let state = observer.states.last().expect("a checkpoint");
    let refused = case.refined_from(scene, &views, &other, Some(state), &mut NoRefineObserver);
    assert!(matches!(refused, Err(CuarError::State { .. })), "the state of a different run");
}
