//! The solver.

use crate::kernel::{BlockKernel, DenseKernel, Kernel, LogDenseKernel, MAX_SCALED_RANGE};
use crate::problem::Cost;
use crate::sweeps::Sweeps;
use crate::{EntropyReference, SinkhornParams, Storage, UotError, UotOutput, UotProblem};

/// Least λ0 of the structured kernel with f64 storage: `exp(±3/λ0)` must be finite.
const MIN_LAMBDA_F64: f64 = 0.005;
/// Least λ0 with f32 storage: `exp(−1/λ0)` must be a normal f32 with room to spare.
const MIN_LAMBDA_F32: f64 = 0.02;

/// Generalised Sinkhorn iteration for the objective of the [crate documentation](crate).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sinkhorn {
    params: SinkhornParams,
}

impl Sinkhorn {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`UotError::BadParam`] unless all weights are positive and finite, the tolerance is finite and not negative,
    /// and at least one sweep is allowed.
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
    /// [`UotError::LambdaTooSmall`] when λ0 is below what the structured kernel can represent (0.005, or 0.02 with
    /// f32 storage), [`UotError::NonUniformMarginals`] for a reference other than `Kl` with given marginals,
    /// [`UotError::TooLarge`] when the near field would exceed 2³¹ entries.
    pub fn solve(&self, problem: &UotProblem<'_>) -> Result<UotOutput, UotError> {
        let params = self.params;
        if params.reference != EntropyReference::Kl && problem.marginals.is_some() {
            return Err(UotError::NonUniformMarginals { reference: params.reference });
        }
        match &problem.cost {
            Cost::Dense { values, least, largest, .. } => {
                let m = problem.num_cols();
                let magnitude = least.abs().max(largest.abs()) / params.lambda_ent;
                if magnitude > 1e300 {
                    let expected = "at least 1e-300 times the largest cost";
                    let (name, value) = ("lambda_ent", params.lambda_ent);
                    return Err(UotError::BadParam { name, value, expected });
                }
                if (largest - least) / params.lambda_ent <= MAX_SCALED_RANGE {
                    let mut kernel = DenseKernel::new(values, m, *least, params.lambda_ent);
                    Ok(self.iterate(problem, &mut kernel, None, values.len()))
                } else {
                    let mut kernel = LogDenseKernel::new(values, m, params.lambda_ent);
                    Ok(self.iterate(problem, &mut kernel, None, values.len()))
                }
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
                let orders = Some((&field.src.order[..], &field.edit.order[..]));
                match storage {
                    Storage::F64 => {
                        let mut kernel = BlockKernel::<f64>::new(field, lambda_ent)?;
                        let entries = kernel.num_entries();
                        Ok(self.iterate(problem, &mut kernel, orders, entries))
                    }
                    Storage::F32 => {
                        let mut kernel = BlockKernel::<f32>::new(field, lambda_ent)?;
                        let entries = kernel.num_entries();
                        Ok(self.iterate(problem, &mut kernel, orders, entries))
                    }
                }
            }
        }
    }

    fn iterate(
        &self,
        problem: &UotProblem<'_>,
        kernel: &mut dyn Kernel,
        orders: Option<(&[u32], &[u32])>,
        entries: usize,
    ) -> UotOutput {
        let (log_a, log_b) = log_marginals(problem);
        let (log_a, log_b) = match orders {
            Some((rows, cols)) => (gather(&log_a, rows), gather(&log_b, cols)),
            None => (log_a, log_b),
        };
        let mut scalings = Sweeps::new(kernel, log_a, log_b, self.params).run();
        if let Some((rows, cols)) = orders {
            for (values, order) in [
                (&mut scalings.log_u, rows),
                (&mut scalings.log_kv, rows),
                (&mut scalings.log_v, cols),
                (&mut scalings.log_ku, cols),
            ] {
                *values = scatter(values, order);
            }
        }
        UotOutput::new(problem, &self.params, scalings, entries)
    }
}

/// Checks the parameters and solves: [`Sinkhorn::new`] and [`Sinkhorn::solve`] in one call.
///
/// # Errors
/// As those two.
pub fn solve(problem: &UotProblem<'_>, params: &SinkhornParams) -> Result<UotOutput, UotError> {
    Sinkhorn::new(*params)?.solve(problem)
}

/// `ln a` and `ln b` in original order.
pub(crate) fn log_marginals(problem: &UotProblem<'_>) -> (Vec<f64>, Vec<f64>) {
    if let Some((a, b)) = &problem.marginals {
        (a.iter().map(|w| w.ln()).collect(), b.iter().map(|w| w.ln()).collect())
    } else {
        let (n, m) = (problem.num_rows(), problem.num_cols());
        (vec![-(n as f64).ln(); n], vec![-(m as f64).ln(); m])
    }
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
