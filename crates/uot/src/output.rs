//! Result of the solver.

use crate::problem::check_dense_size;
use crate::sweeps::Scalings;
use crate::{EntropyReference, SinkhornParams, UotError, UotProblem};
use rayon::prelude::*;

/// Potentials and masses of the plan, and convergence of the iteration.
///
/// With `ρ = a bᵀ` for [`EntropyReference::Kl`], 1 for `Entropy` and 1/e for `PLogP`, the plan is
/// `P_ij = ρ_ij exp((f_i + g_j − D_ij)/λ0)`, and at the optimum `f = −λ1 ln(P1/a)`, `g = −λ2
/// ln(Pᵀ1/b)` (mass without counterpart, `ρ exp((f − c)/λ0)`, included in the sums). If a marginal
/// is enforced (λ = ∞), `P1 = a` or `Pᵀ1 = b` instead; if both are, `f` and `g` are defined up to a
/// constant that may be moved between them. The plan is computed on demand from the problem.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct UotOutput {
    /// Row potentials, cost units, `[n]`.
    pub f: Vec<f64>,
    /// Column potentials, cost units, `[m]`.
    pub g: Vec<f64>,
    /// Row sums of the plan `P1`, unit of the weights, `[n]`.
    pub row_mass: Vec<f64>,
    /// Column sums of the plan `Pᵀ1`, unit of the weights, `[m]`.
    pub col_mass: Vec<f64>,
    /// Mass of rows without counterpart, `[n]`; empty without [`UotProblem::with_unmatched_rows`].
    pub unmatched_row_mass: Vec<f64>,
    /// Mass of columns without counterpart, `[m]`; empty without
    /// [`UotProblem::with_unmatched_cols`].
    pub unmatched_col_mass: Vec<f64>,
    /// Sum of the plan: transported mass, unit of the weights.
    pub total_mass: f64,
    /// Value of the objective for the chosen reference, cost units.
    pub objective: f64,
    /// Whether the potentials moved by less than `tol · λ0` in the last sweep.
    pub converged: bool,
    /// Number of sweeps, those at larger entropy weights included; a sweep updates both sides.
    pub sweeps: usize,
    /// Number of products with the kernel or its transpose, the final ones included.
    pub matvecs: usize,
    /// Largest change of `f/λ0` and `g/λ0` that an unaccelerated step would make, one per sweep.
    pub residuals: Vec<f64>,
    /// Number of stored entries of the kernel, zeros inside blocks included.
    pub stored_entries: usize,
    pub(crate) lambda_ent: f64,
    pub(crate) reference: EntropyReference,
}

impl UotOutput {
    pub(crate) fn new(
        problem: &UotProblem<'_>,
        params: &SinkhornParams,
        scalings: Scalings,
        stored_entries: usize,
    ) -> Self {
        let SinkhornParams { lambda_ent, lambda_a, lambda_b, reference, .. } = *params;
        let (log_a, log_b) = problem.log_marginals();
        // subtracting a constant from the cost scales the plan: see EntropyReference
        let shift = reference_shift(problem, params);
        let (share_a, share_b) = params.level_shares();
        let log_factor = shift / (lambda_ent + lambda_a + lambda_b);
        let mass = |log_weight: &[f64], log_scaling: &[f64], log_k: &[f64]| -> Vec<f64> {
            let terms = log_weight.iter().zip(log_scaling).zip(log_k);
            terms.map(|((w, s), k)| (w + s + k + log_factor).exp()).collect()
        };
        let row_mass = mass(&log_a, &scalings.log_u, &scalings.log_kv);
        let col_mass = mass(&log_b, &scalings.log_v, &scalings.log_ku);
        let potential = |log_scaling: &[f64], share: f64| -> Vec<f64> {
            log_scaling.iter().map(|s| lambda_ent * s - share * shift).collect()
        };
        let f = potential(&scalings.log_u, share_a);
        let g = potential(&scalings.log_v, share_b);
        let total_mass: f64 = col_mass.iter().sum();
        let unmatched = |costs: &Option<Vec<f64>>, log_weight: &[f64], potentials: &[f64]| {
            costs.as_ref().map_or_else(Vec::new, |costs| -> Vec<f64> {
                let terms = log_weight.iter().zip(potentials).zip(costs);
                terms.map(|((w, p), c)| (w + (p - c) / lambda_ent).exp()).collect()
            })
        };
        let unmatched_row_mass = unmatched(&problem.unmatched.rows, &log_a, &f);
        let unmatched_col_mass = unmatched(&problem.unmatched.cols, &log_b, &g);
        let mut out = Self {
            f,
            g,
            row_mass,
            col_mass,
            unmatched_row_mass,
            unmatched_col_mass,
            total_mass,
            objective: 0.0,
            converged: scalings.converged,
            sweeps: scalings.residuals.len(),
            matvecs: scalings.matvecs,
            residuals: scalings.residuals,
            stored_entries,
            lambda_ent,
            reference,
        };
        out.objective = out.objective(params, &log_a, &log_b);
        out
    }

    /// Value of the objective, cost units, from the potentials and masses.
    fn objective(&self, params: &SinkhornParams, log_a: &[f64], log_b: &[f64]) -> f64 {
        let SinkhornParams { lambda_ent, lambda_a, lambda_b, reference, .. } = *params;
        let row_total = total(&self.row_mass, &self.unmatched_row_mass);
        let col_total = total(&self.col_mass, &self.unmatched_col_mass);
        let weight = |log: &[f64]| log.iter().map(|w| w.exp()).sum::<f64>();
        let (sum_a, sum_b) = (weight(log_a), weight(log_b));
        let reference_mass = if reference == EntropyReference::Kl { sum_a * sum_b } else { 0.0 };
        // ⟨D,P⟩ cancels between the cost and the entropy, whose logarithm is (f + g − D)/λ0
        let mut objective = product(&self.f, &row_total)
            + product(&self.g, &col_total)
            + lambda_ent * (reference_mass - self.total_mass);
        for (mass, weight) in [(&self.unmatched_row_mass, sum_a), (&self.unmatched_col_mass, sum_b)]
        {
            if !mass.is_empty() {
                objective += lambda_ent * (weight - mass.iter().sum::<f64>());
            }
        }
        // an enforced marginal is met: its divergence is zero
        if lambda_a.is_finite() {
            objective += lambda_a * divergence(&row_total, log_a, sum_a);
        }
        if lambda_b.is_finite() {
            objective += lambda_b * divergence(&col_total, log_b, sum_b);
        }
        objective
    }

    /// The whole plan, `[n, m]` row-major.
    ///
    /// # Errors
    /// [`UotError::TooLarge`] above 2e8 entries, [`UotError::Mismatch`] for a problem of a
    /// different size.
    pub fn plan(&self, problem: &UotProblem<'_>) -> Result<Vec<f64>, UotError> {
        self.check(problem)?;
        let (n, m) = (problem.num_rows(), problem.num_cols());
        check_dense_size("the plan", n, m)?;
        let logs = self.log_factors(problem);
        let columns = problem.map_columns(|j, entries| self.fill_column(&logs, j, entries));
        let mut plan = vec![0.0; n * m];
        plan.par_chunks_mut(m).enumerate().for_each(|(i, row)| {
            for (value, column) in row.iter_mut().zip(&columns) {
                *value = column[i];
            }
        });
        Ok(plan)
    }

    /// Column `j` of the plan, `[n]`.
    ///
    /// # Errors
    /// [`UotError::Mismatch`] for a problem of a different size, [`UotError::BadParam`] when `j` is
    /// not a column.
    pub fn plan_column(&self, problem: &UotProblem<'_>, j: usize) -> Result<Vec<f64>, UotError> {
        self.check(problem)?;
        if j >= problem.num_cols() {
            let expected = "the id of a column";
            return Err(UotError::BadParam { name: "j", value: j as f64, expected });
        }
        Ok(self.fill_column(&self.log_factors(problem), j, &problem.column(j)))
    }

    /// `⟨D, P⟩`, cost units. One pass over the near pairs.
    ///
    /// # Errors
    /// [`UotError::Mismatch`] for a problem of a different size.
    pub fn transport_cost(&self, problem: &UotProblem<'_>) -> Result<f64, UotError> {
        self.check(problem)?;
        let logs = self.log_factors(problem);
        let saved: f64 = problem
            .map_columns(|j, entries| {
                let each = entries.iter().map(|&(i, w)| w * logs.entry(i as usize, j, w));
                each.sum::<f64>()
            })
            .iter()
            .sum();
        Ok(problem.far_cost() * self.total_mass - saved)
    }

    fn fill_column(&self, logs: &LogFactors, j: usize, entries: &[(u32, f64)]) -> Vec<f64> {
        let mut column: Vec<f64> = if logs.complete {
            vec![0.0; self.f.len()]
        } else {
            (0..self.f.len()).map(|i| logs.entry(i, j, 0.0)).collect()
        };
        for &(i, w) in entries {
            column[i as usize] = logs.entry(i as usize, j, w);
        }
        column
    }

    pub(crate) fn check(&self, problem: &UotProblem<'_>) -> Result<(), UotError> {
        let (output_rows, output_cols) = (self.f.len(), self.g.len());
        let (rows, cols) = (problem.num_rows(), problem.num_cols());
        if (output_rows, output_cols) == (rows, cols) {
            Ok(())
        } else {
            Err(UotError::Mismatch { output_rows, output_cols, rows, cols })
        }
    }

    pub(crate) fn log_factors(&self, problem: &UotProblem<'_>) -> LogFactors {
        let inverse = self.lambda_ent.recip();
        let (log_a, log_b) = if self.reference == EntropyReference::Kl {
            problem.log_marginals()
        } else {
            (vec![0.0; self.f.len()], vec![0.0; self.g.len()])
        };
        let far = problem.far_cost();
        let reference = if self.reference == EntropyReference::PLogP { 1.0 } else { 0.0 };
        LogFactors {
            rows: log_a.iter().zip(&self.f).map(|(a, f)| a + f * inverse).collect(),
            cols: log_b
                .iter()
                .zip(&self.g)
                .map(|(b, g)| b - reference + (g - far) * inverse)
                .collect(),
            inverse,
            complete: problem.lists_every_row(),
        }
    }
}

/// `ln P_ij = rows_i + cols_j + w_ij/λ0`, with `w = far_cost − D`.
pub(crate) struct LogFactors {
    pub(crate) rows: Vec<f64>,
    pub(crate) cols: Vec<f64>,
    pub(crate) inverse: f64,
    /// Whether unlisted pairs have zero mass.
    pub(crate) complete: bool,
}

impl LogFactors {
    pub(crate) fn entry(&self, i: usize, j: usize, w: f64) -> f64 {
        (self.rows[i] + self.cols[j] + w * self.inverse).exp()
    }
}

/// Mass of the plan and mass without counterpart.
fn total(mass: &[f64], unmatched: &[f64]) -> Vec<f64> {
    let rest = unmatched.iter().copied().chain(std::iter::repeat(0.0));
    mass.iter().zip(rest).map(|(mass, rest)| mass + rest).collect()
}

fn product(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// `Σ x ln(x/y) − x + y`, with `0 ln 0 = 0`.
fn divergence(x: &[f64], log_y: &[f64], sum_y: f64) -> f64 {
    let terms = x.iter().zip(log_y).filter(|(x, _)| **x > 0.0);
    terms.map(|(x, log_y)| x * (x.ln() - log_y) - x).sum::<f64>() + sum_y
}

/// Constant by which the cost decreases when the reference of the entropy changes from `a bᵀ` to
/// the chosen one, cost units: the potentials of the chosen one are lower by it, in the shares of
/// [`SinkhornParams::level_shares`].
pub(crate) fn reference_shift(problem: &UotProblem<'_>, params: &SinkhornParams) -> f64 {
    let log_pairs = (problem.num_rows() as f64).ln() + (problem.num_cols() as f64).ln();
    match params.reference {
        EntropyReference::Kl => 0.0,
        EntropyReference::Entropy => params.lambda_ent * log_pairs,
        EntropyReference::PLogP => params.lambda_ent * (log_pairs - 1.0),
    }
}
