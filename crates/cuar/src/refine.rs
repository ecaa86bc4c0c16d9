//! The stage: [`refine`].

use crate::{
    Backend, CuarError, OffsetScene, RefineOptions, RefineReport, Views,
    evaluator::Evaluator,
    fingerprint::{fingerprint, fingerprint_of_inputs},
    observer::RefineObserver,
    problem::{Problem, Watch, num_lanes},
    sample::Sample,
    sample_source::Source,
    scene,
    solve::{Outcome, accept, solve},
    state::State,
    supervision::Supervision,
    view_sampler::DrawnViews,
};
use gs_core::{DynamicScene, Rasterizer, Splats};
use std::ops::Range;
use std::time::Instant;

/// Result of a refinement.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Refined {
    /// Rows that may have changed: the edited ones, ascending.
    pub rows: Vec<u32>,
    /// New SH of these rows at the edited frame, `[rows,K,3]`.
    pub sh: Vec<[f32; 3]>,
    /// Offset of SH, the same at every time, `[rows,K,3]`.
    pub d_sh: Vec<[f32; 3]>,
    /// Rows that fade: remnants of deleted objects ([`crate::refine_edit()`]); ascending, among
    /// `rows`.
    pub faded: Vec<u32>,
    /// Counts, losses, timings and warnings.
    pub report: RefineReport,
}

impl Refined {
    /// Writes the refined rows into the splats of the edited frame.
    ///
    /// # Panics
    /// If the number or SH degree of the splats differs.
    pub fn apply(&self, first: &mut Splats) {
        scene::add(first, &self.rows, &self.d_sh);
        scene::fade(first, &self.faded);
    }

    /// `scene` with the refined colours at every time.
    pub fn scene<'a>(&'a self, scene: &'a dyn DynamicScene) -> OffsetScene<'a> {
        OffsetScene::new(scene, &self.rows, &self.d_sh, &self.faded)
    }
}

/// Refines the colours of the `edited` rows of `scene` (Eqs. 11–20): renders of the edited frame
/// are warped to other times and supervise uncertain pixels there. One offset of SH per row, shared
/// by all times. All other rows, and all geometry, do not change.
///
/// `resume` is a state that [`RefineObserver::checkpoint`] received in a run with the same inputs;
/// the result is that of the uninterrupted run (bit-identical with a deterministic rasteriser).
///
/// # Errors
/// If inputs are inconsistent or out of range, the scene or the rasteriser fails, the state is from
/// a different run, or the observer cancels.
pub fn refine<R: Rasterizer<Prepared: Send> + Sync>(
    raster: &R,
    scene: &dyn DynamicScene,
    edited: &[bool],
    views: &Views,
    options: &RefineOptions,
    resume: Option<&State>,
    observer: &mut dyn RefineObserver,
) -> Result<Refined, CuarError> {
    let backend = Backend { raster, descent: None };
    refine_with(backend, scene, edited, views, options, resume, observer)
}

/// [`refine`], with the steps of Adam executed by the engine of `backend` if it has one: the same
/// result within the engine's precision.
///
/// # Errors
/// As [`refine`].
pub fn refine_with<R: Rasterizer<Prepared: Send> + Sync>(
    backend: Backend<'_, R>,
    scene: &dyn DynamicScene,
    edited: &[bool],
    views: &Views,
    options: &RefineOptions,
    resume: Option<&State>,
    observer: &mut dyn RefineObserver,
) -> Result<Refined, CuarError> {
    options.check()?;
    let Backend { raster, descent } = backend;
    let Inputs { edit_time, first, rows, row_of, drawn } =
        Inputs::of(scene, edited, views, options)?;
    let mut report = RefineReport { num_edited: rows.len(), ..RefineReport::default() };

    let begun = Instant::now();
    let num_lanes = num_lanes(views.cameras, options.memory);
    let source = Source { raster, options, edited, row_of: &row_of, first: &first };
    let mut stage = Supervision::new(scene, views, source, num_lanes);
    let total = drawn.samples.len() + drawn.held_out.len();
    let inputs = fingerprint_of_inputs(&first, &rows, options, views.cameras);
    let mut watch = Watch::new(observer, options, "images", total, 0);
    watch.begin_images(inputs);
    let mut samples = stage.build(&drawn.samples, options.memory, 0, &mut watch, &mut report)?;
    let stats = stage.stats;
    report.supervision = stats;
    report.num_floored = stage.num_floored;
    let share = |&[uncertain, seen]: &[u32; 2]| uncertain as f32 / seen.max(1) as f32;
    let uncertain_shares = stage.uncertain_counts.iter().map(share).collect();
    let held_out =
        stage.build(&drawn.held_out, usize::MAX, drawn.samples.len(), &mut watch, &mut report)?;
    drop(stage);
    report.samples = samples.iter().map(|sample| sample.at).collect();
    report.held_out = held_out.iter().map(|sample| sample.at).collect();
    if samples.is_empty() && !rows.is_empty() {
        report.warnings.push("no image shows an edited splat: nothing was refined".to_owned());
    } else if stats.masked == 0 {
        report.warnings.push("no artifact was found: colours are unchanged".to_owned());
    } else if stats.supervised() == 0 {
        report.warnings.push(format!(
            "{:.1} % of the edited pixels look like artifacts, but frame 1 supervises \
             none of them ({}); colours are unchanged",
            100.0 * stats.masked as f64 / stats.live.max(1) as f64,
            stats.reasons()
        ));
    }
    let images_secs = begun.elapsed().as_secs_f64();

    let is_first = |sample: &Sample<_>| sample.at.time == edit_time;
    samples.sort_by_key(is_first);
    let mut problem = Problem {
        raster,
        options,
        cameras: views.cameras,
        num_first: samples.iter().filter(|sample| is_first(sample)).count(),
        samples,
        lanes: (0..num_lanes).map(|_| Evaluator::default()).collect(),
        num_rows: rows.len(),
        sh_degree: first.sh_degree,
        base_sh: rows.iter().flat_map(|&row| first.sh_of(row as usize)).copied().collect(),
        uncertain_shares,
        bytes: 0,
        num_cached: 0,
    };
    let mut seen = vec![false; rows.len()];
    for entry in problem.samples.iter().flat_map(|sample| &sample.entries) {
        seen[entry.row as usize] = true;
    }
    report.num_visible = seen.iter().filter(|seen| **seen).count();
    problem.cache()?;
    let cache_secs = begun.elapsed().as_secs_f64() - images_secs;

    let fingerprint = fingerprint(inputs, &problem.samples);
    if let Some(state) = resume.filter(|state| state.fingerprint != fingerprint) {
        return Err(CuarError::State {
            what: format!(
                "it was saved with different inputs or options (fingerprint {:016x}, expected {fingerprint:016x})",
                state.fingerprint
            ),
        });
    }
    let zero = Outcome {
        d_sh: vec![[0.0; 3]; rows.len() * problem.coeffs()],
        before: None,
        regression: None,
    };
    // Without an artifact the loss is minimal at zero offsets.
    let outcome = if stats.supervised() == 0 {
        zero.clone()
    } else {
        solve(&mut problem, descent, resume, fingerprint, observer, &mut report.trace)?
    };
    let solve_secs = begun.elapsed().as_secs_f64() - images_secs - cache_secs;
    let parts = ["prepare", "forward", "loss", "backward"];
    report.timings = vec![("images", images_secs), ("cache", cache_secs), ("solve", solve_secs)];
    let of_lanes = |part: usize| problem.lanes.iter().map(|lane| lane.secs[part]).sum();
    report.timings.extend(parts.into_iter().enumerate().map(|(k, part)| (part, of_lanes(k))));
    report.bytes = problem.bytes;
    report.num_cached = problem.num_cached;

    let total = problem.samples.len() + 2 * held_out.len();
    let mut watch = Watch::new(observer, options, "report", total, 0);
    let mut reported = 0;
    let mut loss_of = |problem: &mut Problem<R>, outcome: &Outcome| {
        let begun = reported;
        problem.loss(&outcome.d_sh, |done| {
            reported = total.min(begun + done);
            watch.step(reported, None);
            watch.stop_if_cancelled()
        })
    };
    let before = if let Some(before) = outcome.before {
        before
    } else {
        let [exact, shaped, _] = loss_of(&mut problem, &zero)?;
        [exact, shaped]
    };
    let (outcome, after, note) =
        accept(&mut problem, options, outcome, zero.clone(), before, &mut loss_of)?;
    report.warnings.extend(note);
    problem.num_first = 0;
    problem.samples = held_out;
    [report.held_out_before, _, report.held_out_artifacts[0]] = loss_of(&mut problem, &zero)?;
    [report.held_out_after, _, report.held_out_artifacts[1]] = loss_of(&mut problem, &outcome)?;
    (report.loss_before, report.loss_after) = (before[0], after[0]);
    // A warning, not an error. There is none if colours change only outside the mask, because the
    // earlier colours may be wrong there.
    let [then, now] = report.held_out_artifacts;
    if now > then {
        report.warnings.push(format!(
            "in held-out views, artifacts differ more from frame 1 than before (loss {then:.3e} to {now:.3e}): check the result in these views"
        ));
    }

    let mut refined = Refined { rows, d_sh: outcome.d_sh, report, ..Refined::default() };
    let mut changed = first;
    refined.apply(&mut changed);
    for &row in &refined.rows {
        refined.sh.extend_from_slice(changed.sh_of(row as usize));
    }
    Ok(refined)
}

/// Makes the `share` of the images that [`refine_with`] supervises with, for the observer; returns
/// the number of images of all shares.
pub(crate) fn images_of<R: Rasterizer<Prepared: Send> + Sync>(
    raster: &R,
    scene: &dyn DynamicScene,
    edited: &[bool],
    views: &Views,
    options: &RefineOptions,
    share: &dyn Fn(usize) -> Range<usize>,
    observer: &mut dyn RefineObserver,
) -> Result<usize, CuarError> {
    let Inputs { first, rows, row_of, mut drawn, .. } = Inputs::of(scene, edited, views, options)?;
    drawn.samples.append(&mut drawn.held_out);
    let share = &drawn.samples[share(drawn.samples.len())];
    let source = Source { raster, options, edited, row_of: &row_of, first: &first };
    let lanes = num_lanes(views.cameras, options.memory);
    let mut watch = Watch::new(observer, options, "images", share.len(), 0);
    watch.begin_images(fingerprint_of_inputs(&first, &rows, options, views.cameras));
    Supervision::new(scene, views, source, lanes).keep(share, &mut watch)?;
    Ok(drawn.samples.len())
}

/// Values that a refinement derives from its arguments.
struct Inputs {
    edit_time: f32,
    /// The edited frame.
    first: Splats,
    /// Edited rows, ascending.
    rows: Vec<u32>,
    /// Position of each splat among `rows`, or `u32::MAX`.
    row_of: Vec<u32>,
    /// Views and times of the images.
    drawn: DrawnViews,
}

impl Inputs {
    fn of(
        scene: &dyn DynamicScene,
        edited: &[bool],
        views: &Views,
        options: &RefineOptions,
    ) -> Result<Self, CuarError> {
        let range = scene.time_range();
        views.check(range)?;
        let edit_time = options.edit_time.unwrap_or(range.start);
        let first = scene.at(edit_time)?;
        first.check_shapes()?;
        CuarError::check("edited", edited.len(), first.len())?;
        let (rows, row_of) = number(edited);
        let keep_first = options.keep_first_frame.then_some(edit_time);
        let drawn = views.draw(options.samples, keep_first, edit_time, options.seed);
        Ok(Self { edit_time, first, rows, row_of, drawn })
    }
}

/// Edited rows, and the position of each splat among them.
fn number(edited: &[bool]) -> (Vec<u32>, Vec<u32>) {
    let mut rows = Vec::new();
    let mut row_of = vec![u32::MAX; edited.len()];
    for ((id, &edited), row) in (0_u32..).zip(edited).zip(&mut row_of) {
        if edited {
            #[expect(clippy::cast_possible_truncation, reason = "fewer than the 32-bit ids")]
            let next = rows.len() as u32;
            *row = next;
            rows.push(id);
        }
    }
    (rows, row_of)
}
