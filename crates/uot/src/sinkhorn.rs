//! The solver.

use crate::kernel::{
    BlockKernel, DenseKernel, Kernel, LogDenseKernel, MAX_SCALED_RANGE, SparseKernel,
};
use crate::near::NearField;
use crate::output::reference_shift;
use crate::problem::Cost;
use crate::sweeps::{Scalings, Sides, Sweeps};
use crate::{
    EntropyReference, EpsilonScaling, SinkhornParams, Storage, UotError, UotOutput, UotProblem,
};

/// Minimum λ0 of the structured kernel with f64 storage: `exp(±3/λ0)` must be finite.
const MIN_LAMBDA_F64: f64 = 0.005;
/// Minimum λ0 with f32 storage: `exp(−1/λ0)` must be a normal f32, with a margin.
const MIN_LAMBDA_F32: f64 = 0.02;

/// Range of the costs, in λ0, above which [`EpsilonScaling::Auto`] starts with larger weights.
const SCALED_ABOVE: f64 = 50.0;
/// Tolerance and maximum number of sweeps for all weights but the last: their solutions are only
/// starting points.
const COARSE_TOL: f64 = 1e-2;
const COARSE_SWEEPS: usize = 100;
/// Largest relative difference of the sums of two marginals that are both enforced.
const MASS_TOL: f64 = 1e-9;

/// Generalised Sinkhorn iteration for the objective of the [crate documentation](crate).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sinkhorn {
    params: SinkhornParams,
}

impl Sinkhorn {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`UotError::BadParam`] unless λ0 is positive and finite, the other weights are positive, the
    /// tolerance is finite and not negative, and at least one sweep is allowed.
    pub fn new(params: SinkhornParams) -> Result<Self, UotError> {
        params.validate()?;
        Ok(Self { params })
    }

    /// The parameters.
    pub fn params(&self) -> &SinkhornParams {
        &self.params
    }

    /// Solves the problem. Not reaching the tolerance is reported in [`UotOutput::converged`].
    ///
    /// # Errors
    /// [`UotError::LambdaTooSmall`] when λ0 is below what the structured kernel can represent
    /// (0.005, or 0.02 with f32 storage), [`UotError::NonUniformMarginals`] or
    /// [`UotError::ReferenceWithUnmatched`] for a reference other than `Kl` with given marginals or
    /// unmatched costs, [`UotError::UnequalMasses`] and [`UotError::Infeasible`] for marginals that
    /// cannot be enforced, [`UotError::TooLarge`] when the near field would exceed 2³¹ entries.
    pub fn solve(&self, problem: &UotProblem<'_>) -> Result<UotOutput, UotError> {
        self.start(problem, None)
    }

    /// [`Self::solve`], started from column potentials `g` `[m]`, cost units: those of a similar
    /// problem ([`UotOutput::g`]), of any λ. Row potentials follow from them in the first
    /// half-sweep. The result is that of a cold start up to the tolerance, usually in fewer sweeps;
    /// ε-scaling is skipped.
    ///
    /// # Errors
    /// As [`Self::solve`], and [`UotError::BadLength`] or [`UotError::BadValue`] for potentials of
    /// a different length or that are not finite.
    pub fn solve_from(&self, problem: &UotProblem<'_>, g: &[f64]) -> Result<UotOutput, UotError> {
        let expected = problem.num_cols();
        if g.len() != expected {
            return Err(UotError::BadLength { what: "g", found: g.len(), expected });
        }
        if let Some(index) = g.iter().position(|value| !value.is_finite()) {
            let expected = "finite potentials";
            return Err(UotError::BadValue { what: "g", index, value: g[index], expected });
        }
        self.start(problem, Some(g))
    }

    fn start(&self, problem: &UotProblem<'_>, g: Option<&[f64]>) -> Result<UotOutput, UotError> {
        let params = self.params;
        let marginals = self.marginals(problem)?;
        match &problem.cost {
            Cost::Dense { values, smallest, largest, .. } => {
                let m = problem.num_cols();
                let kernel = |lambda_ent: f64| -> Box<dyn Kernel + '_> {
                    if (largest - smallest) / lambda_ent <= MAX_SCALED_RANGE {
                        Box::new(DenseKernel::new(values, m, *smallest, lambda_ent))
                    } else {
                        Box::new(LogDenseKernel::new(values, m, lambda_ent))
                    }
                };
                let weights = self.weights(*smallest, *largest, g.is_some())?;
                Ok(self.descend(problem, marginals, &weights, g, values.len(), kernel))
            }
            Cost::Sparse(cost) => {
                let kernel = |lambda_ent: f64| -> Box<dyn Kernel + '_> {
                    Box::new(SparseKernel::new(cost, lambda_ent))
                };
                let weights = self.weights(cost.smallest, cost.largest, g.is_some())?;
                Ok(self.descend(problem, marginals, &weights, g, cost.values.len(), kernel))
            }
            Cost::Near { field, storage } => {
                let (minimum, kernel, instead) = match storage {
                    Storage::F64 => {
                        (MIN_LAMBDA_F64, "structured kernel", "UotProblem::welsch_dense")
                    }
                    Storage::F32 => (MIN_LAMBDA_F32, "near field stored as f32", "Storage::F64"),
                };
                let lambda_ent = params.lambda_ent;
                if lambda_ent < minimum {
                    return Err(UotError::LambdaTooSmall { lambda_ent, minimum, kernel, instead });
                }
                match storage {
                    Storage::F64 => {
                        let kernel = BlockKernel::<f64>::new(field, lambda_ent)?;
                        Ok(self.near(problem, &marginals, field, g, kernel.num_entries(), kernel))
                    }
                    Storage::F32 => {
                        let kernel = BlockKernel::<f32>::new(field, lambda_ent)?;
                        Ok(self.near(problem, &marginals, field, g, kernel.num_entries(), kernel))
                    }
                }
            }
        }
    }

    /// Sequence of entropy weights, the requested one last.
    fn weights(&self, smallest: f64, largest: f64, warm: bool) -> Result<Vec<f64>, UotError> {
        let target = self.params.lambda_ent;
        if smallest.abs().max(largest.abs()) / target > 1e300 {
            let expected = "at least 1e-300 times the largest cost";
            return Err(UotError::BadParam { name: "lambda_ent", value: target, expected });
        }
        let range = largest - smallest;
        let (mut weight, decay) = match self.params.epsilon_scaling {
            _ if warm => (target, 0.5),
            EpsilonScaling::Auto if range > SCALED_ABOVE * target => (0.1 * range, 0.25),
            EpsilonScaling::Auto | EpsilonScaling::Off => (target, 0.5),
            EpsilonScaling::From { init, decay } => (init, decay),
        };
        let mut weights = Vec::new();
        while weight > target {
            weights.push(weight);
            weight *= decay;
        }
        weights.push(target);
        Ok(weights)
    }

    /// Solves for each entropy weight in turn, starting from the previous potentials.
    fn descend<'k>(
        &self,
        problem: &UotProblem<'_>,
        marginals: LogMarginals,
        weights: &[f64],
        g: Option<&[f64]>,
        entries: usize,
        kernel: impl Fn(f64) -> Box<dyn Kernel + 'k>,
    ) -> UotOutput {
        let mut g = self.plain_potentials(problem, g);
        let mut done = Spent::default();
        for &lambda_ent in &weights[..weights.len() - 1] {
            let tol = self.params.tol.max(COARSE_TOL);
            let left = self.params.max_sweeps - done.residuals.len();
            let max_sweeps = (left / 2).clamp(1, COARSE_SWEEPS);
            if left <= max_sweeps {
                break;
            }
            let params = SinkhornParams { lambda_ent, tol, max_sweeps, ..self.params };
            let sides = sides(problem, marginals.clone(), lambda_ent);
            let start = g.iter().map(|g| g / lambda_ent).collect();
            let found = Sweeps::new(&mut *kernel(lambda_ent), sides, start, true, params).run();
            g = found.log_v.iter().map(|v| lambda_ent * v).collect();
            done.add(&found);
        }
        let lambda_ent = self.params.lambda_ent;
        let params = SinkhornParams {
            max_sweeps: self.params.max_sweeps - done.residuals.len(),
            ..self.params
        };
        let sides = sides(problem, marginals, lambda_ent);
        let start = g.iter().map(|g| g / lambda_ent).collect();
        let mut found = Sweeps::new(&mut *kernel(lambda_ent), sides, start, true, params).run();
        done.add(&found);
        found.residuals = done.residuals;
        found.matvecs = done.matvecs;
        UotOutput::new(problem, &self.params, found, entries)
    }

    /// One run in the order of the points' trees.
    fn near(
        &self,
        problem: &UotProblem<'_>,
        marginals: &LogMarginals,
        field: &NearField<'_>,
        g: Option<&[f64]>,
        entries: usize,
        mut kernel: impl Kernel,
    ) -> UotOutput {
        let lambda_ent = self.params.lambda_ent;
        let (rows, cols) = (&field.rows.order[..], &field.cols.order[..]);
        let all = sides(problem, marginals.clone(), lambda_ent);
        let sides = Sides {
            log_a: gather(&all.log_a, rows),
            log_b: gather(&all.log_b, cols),
            unmatched_a: all.unmatched_a.map(|values| gather(&values, rows)),
            unmatched_b: all.unmatched_b.map(|values| gather(&values, cols)),
        };
        let start: Vec<f64> =
            self.plain_potentials(problem, g).iter().map(|g| g / lambda_ent).collect();
        let mut found =
            Sweeps::new(&mut kernel, sides, gather(&start, cols), false, self.params).run();
        for (values, order) in [
            (&mut found.log_u, rows),
            (&mut found.log_kv, rows),
            (&mut found.log_v, cols),
            (&mut found.log_ku, cols),
        ] {
            *values = scatter(values, order);
        }
        UotOutput::new(problem, &self.params, found, entries)
    }

    /// Column potentials for [`EntropyReference::Kl`] that correspond to those of the chosen
    /// reference; 0 if none are given.
    fn plain_potentials(&self, problem: &UotProblem<'_>, g: Option<&[f64]>) -> Vec<f64> {
        let shift = reference_shift(problem, &self.params) * self.params.level_shares().1;
        match g {
            Some(g) => g.iter().map(|g| g + shift).collect(),
            None => vec![0.0; problem.num_cols()],
        }
    }

    /// Logarithms of the weights that can be transported at all, checked against the enforced
    /// marginals.
    fn marginals(&self, problem: &UotProblem<'_>) -> Result<LogMarginals, UotError> {
        let SinkhornParams { reference, lambda_a, lambda_b, .. } = self.params;
        let unmatched = &problem.unmatched;
        if reference != EntropyReference::Kl {
            if problem.marginals.is_some() {
                return Err(UotError::NonUniformMarginals { reference });
            }
            if unmatched.rows.is_some() || unmatched.cols.is_some() {
                return Err(UotError::ReferenceWithUnmatched { reference });
            }
        }
        if lambda_a.is_infinite()
            && lambda_b.is_infinite()
            && unmatched.rows.is_none()
            && unmatched.cols.is_none()
            && let Some((a, b)) = &problem.marginals
        {
            let (sum_a, sum_b) = (a.iter().sum::<f64>(), b.iter().sum::<f64>());
            if (sum_a - sum_b).abs() > MASS_TOL * sum_a.max(sum_b) {
                return Err(UotError::UnequalMasses { sum_a, sum_b });
            }
        }
        let (mut log_a, mut log_b) = problem.log_marginals();
        if let Cost::Sparse(cost) = &problem.cost {
            let idle_rows = idle(&log_a, &log_b, unmatched.rows.is_some(), |i| cost.row(i));
            let idle_cols = idle(&log_b, &log_a, unmatched.cols.is_some(), |j| cost.col(j));
            for (side, idle, weights, lambda) in [
                ("row", idle_rows, &mut log_a, lambda_a),
                ("column", idle_cols, &mut log_b, lambda_b),
            ] {
                if let (Some(&index), true) = (idle.first(), lambda.is_infinite()) {
                    return Err(UotError::Infeasible { side, index });
                }
                for index in idle {
                    weights[index] = f64::NEG_INFINITY;
                }
            }
        }
        Ok((log_a, log_b))
    }
}

type LogMarginals = (Vec<f64>, Vec<f64>);

/// Ids of rows (or columns) with weight none of whose candidates has any.
fn idle<I: Iterator<Item = (usize, f64)>>(
    own: &[f64],
    other: &[f64],
    may_stay: bool,
    candidates: impl Fn(usize) -> I,
) -> Vec<usize> {
    if may_stay {
        return Vec::new();
    }
    let can_move = |line: usize| candidates(line).any(|(k, _)| other[k] > f64::NEG_INFINITY);
    (0..own.len()).filter(|&line| own[line] > f64::NEG_INFINITY && !can_move(line)).collect()
}

fn sides(problem: &UotProblem<'_>, (log_a, log_b): LogMarginals, lambda_ent: f64) -> Sides {
    let exponents = |costs: &Option<Vec<f64>>| -> Option<Vec<f64>> {
        costs.as_ref().map(|costs| costs.iter().map(|cost| -cost / lambda_ent).collect())
    };
    let unmatched = &problem.unmatched;
    Sides {
        log_a,
        log_b,
        unmatched_a: exponents(&unmatched.rows),
        unmatched_b: exponents(&unmatched.cols),
    }
}

/// Residuals and products of several runs.
#[derive(Default)]
struct Spent {
    residuals: Vec<f64>,
    matvecs: usize,
}

impl Spent {
    fn add(&mut self, found: &Scalings) {
        self.residuals.extend_from_slice(&found.residuals);
        self.matvecs += found.matvecs;
    }
}

/// Checks the parameters and solves: [`Sinkhorn::new`] and [`Sinkhorn::solve`] in one call.
///
/// # Errors
/// As [`Sinkhorn::new`] and [`Sinkhorn::solve`].
pub fn solve(problem: &UotProblem<'_>, params: &SinkhornParams) -> Result<UotOutput, UotError> {
    Sinkhorn::new(*params)?.solve(problem)
}

fn gather(values: &[f64], order: &[u32]) -> Vec<f64> {
    order.iter().map(|&id| values[id as usize]).collect()
}

fn scatter(values: &[f64], order: &[u32]) -> Vec<f64> {
    let mut out = vec![0.0; values.len()];
    for (&id, &value) in order.iter().zip(values) {
        out[id as usize] = value;
    }
    out
}
