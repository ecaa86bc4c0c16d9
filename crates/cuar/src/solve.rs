//! [`solve()`] runs the solver of the options; [`accept`] decides whether its result is used.

use crate::{
    CuarError, DescentEngine, RefineOptions, RegressionParams, Solver,
    descent::Descent,
    observer::RefineObserver,
    problem::{Problem, TracePoint, Watch},
    regression::Regression,
    state::State,
};
use gs_core::Rasterizer;

/// Result of a solver.
#[derive(Clone, Default)]
pub(crate) struct Outcome {
    pub d_sh: Vec<[f32; 3]>,
    /// The losses without offsets, if the solver evaluated them.
    pub before: Option<[f64; 2]>,
    /// The solver, if it can fit again with other parameters.
    pub regression: Option<Regression>,
}

/// The outcome if it lowers the loss, else a refit with less smoothness, else `zero`; also its
/// losses, and a warning for the user.
///
/// The comparison uses the loss that the solver minimises: exact L1 also counts changes that are
/// too small to be visible.
pub(crate) fn accept<R: Rasterizer<Prepared: Send> + Sync>(
    problem: &mut Problem<R>,
    options: &RefineOptions,
    outcome: Outcome,
    zero: Outcome,
    before: [f64; 2],
    mut loss_of: impl FnMut(&mut Problem<R>, &Outcome) -> Result<[f64; 3], CuarError>,
) -> Result<(Outcome, [f64; 2], Option<String>), CuarError> {
    let [exact, shaped, _] = loss_of(problem, &outcome)?;
    let after = [exact, shaped];
    if after[1] <= before[1] {
        return Ok((outcome, after, None));
    }
    // The prior was too strong for these images.
    if let (Some(run), Solver::Regression(params)) = (&outcome.regression, &options.solver) {
        for factor in [0.1, 0.01, 0.0] {
            let params = RegressionParams { prior: factor * params.prior, ..params.clone() };
            let d_sh = run.refit(problem, &params);
            let other = Outcome { d_sh, ..Outcome::default() };
            let [exact, shaped, _] = loss_of(problem, &other)?;
            let after = [exact, shaped];
            if after[1] <= before[1] {
                let note = format!(
                    "smoothness was lowered to {}; otherwise the loss would have risen",
                    params.prior
                );
                return Ok((other, after, Some(note)));
            }
        }
    }
    let note =
        format!("the loss rose from {:.3e} to {:.3e}: colours are unchanged", before[1], after[1]);
    Ok((zero, before, Some(note)))
}

/// Minimises the loss of `problem`, resuming from `resume` if given.
pub(crate) fn solve<R: Rasterizer<Prepared: Send> + Sync>(
    problem: &mut Problem<R>,
    engine: Option<&mut dyn DescentEngine<R::Prepared>>,
    resume: Option<&State>,
    fingerprint: u64,
    observer: &mut dyn RefineObserver,
    trace: &mut Vec<TracePoint>,
) -> Result<Outcome, CuarError> {
    let options = problem.options;
    let first = resume.map_or(0, |state| usize::try_from(state.step).unwrap_or(0));
    match &options.solver {
        Solver::Regression(params) => {
            let mut run = match resume {
                Some(state) => Regression::resume(problem, state)?,
                None => Regression::new(problem),
            };
            let total = params.passes * problem.samples.len();
            let mut watch = Watch::new(observer, options, "refine", total, first);
            run.run(problem, params, fingerprint, &mut watch, trace)?;
            let d_sh = run.d_sh.clone();
            Ok(Outcome { d_sh, before: Some(run.before), regression: Some(run) })
        }
        Solver::Adam(params) => {
            let mut run = match resume {
                Some(state) => Descent::resume(problem, state)?,
                None => Descent::new(problem),
            };
            let mut watch = Watch::new(observer, options, "refine", params.steps, first);
            match engine {
                Some(engine) => {
                    run.run_on(engine, problem, params, fingerprint, &mut watch, trace)?;
                }
                None => run.run(problem, params, fingerprint, &mut watch, trace)?,
            }
            Ok(Outcome { d_sh: run.d_sh, ..Outcome::default() })
        }
    }
}
