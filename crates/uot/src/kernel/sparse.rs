//! Kernel of listed pairs, stored relative to the current scalings.

use super::gibbs::Kernel;
use crate::sparse::SparseCost;
use rayon::prelude::*;

/// Growth of a scaling (natural logarithm) since the stored values were computed, above which they
/// are recomputed.
const MAX_GROWTH: f64 = 100.0;
/// Sums outside `1/SAFE_SUM ..= SAFE_SUM` may lack terms that underflowed, and are recomputed from
/// the costs.
const SAFE_SUM: f64 = 1e200;
/// Share of rows or columns recomputed from the costs above which the stored values are recomputed.
const MAX_UNSAFE_SHARE: f64 = 0.1;
/// Minimum number of rows or columns per parallel task.
const MIN_TASK: usize = 256;

/// `exp(−D_ij/λ0 + row_shift_i + col_shift_j)` of the listed pairs, by row and by column.
///
/// With the shifts near the scalings, the stored value is near the entry of the plan itself: values
/// that underflow are negligible in the plan, for any λ0.
#[derive(Debug)]
pub(crate) struct SparseKernel<'a> {
    cost: &'a SparseCost,
    inverse: f64,
    by_row: Vec<f64>,
    by_col: Vec<f64>,
    row_shift: Vec<f64>,
    col_shift: Vec<f64>,
    /// `e^(x − shift)` of the side that is multiplied.
    scratch: Vec<f64>,
    is_stored: bool,
}

impl<'a> SparseKernel<'a> {
    pub(crate) fn new(cost: &'a SparseCost, lambda_ent: f64) -> Self {
        Self {
            cost,
            inverse: lambda_ent.recip(),
            by_row: vec![0.0; cost.values.len()],
            by_col: vec![0.0; cost.values.len()],
            row_shift: vec![0.0; cost.num_rows()],
            col_shift: vec![0.0; cost.num_cols()],
            scratch: Vec::new(),
            is_stored: false,
        }
    }

    /// Computes the stored values for the current shifts.
    fn store(&mut self) {
        let (cost, inverse) = (self.cost, self.inverse);
        let (row_shift, col_shift) = (&self.row_shift, &self.col_shift);
        let mut rest = &mut self.by_row[..];
        let mut slices = Vec::with_capacity(row_shift.len());
        for i in 0..row_shift.len() {
            let (slice, after) = rest.split_at_mut(cost.row_starts[i + 1] - cost.row_starts[i]);
            slices.push(slice);
            rest = after;
        }
        slices.into_par_iter().enumerate().with_min_len(MIN_TASK).for_each(|(i, slice)| {
            for (value, (j, d)) in slice.iter_mut().zip(cost.row(i)) {
                *value = d.mul_add(-inverse, row_shift[i] + col_shift[j]).exp();
            }
        });
        let by_row = &self.by_row;
        self.by_col
            .par_iter_mut()
            .zip(&cost.positions)
            .with_min_len(1 << 14)
            .for_each(|(value, &at)| *value = by_row[at as usize]);
        self.is_stored = true;
    }
}

/// `ln Σ exp(x_k − D_k/λ0)` over `(k, D_k)`, in two passes; −∞ for an empty sum.
fn log_sum(entries: impl Iterator<Item = (usize, f64)> + Clone, x: &[f64], inverse: f64) -> f64 {
    let term = |(k, d): (usize, f64)| d.mul_add(-inverse, x[k]);
    let top = entries.clone().map(term).fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        return top;
    }
    top + entries.map(|entry| (term(entry) - top).exp()).sum::<f64>().ln()
}

fn outgrown(x: &[f64], shift: &[f64]) -> bool {
    x.iter().zip(shift).any(|(x, s)| x - s > MAX_GROWTH)
}

/// Sets the shifts to the scalings; to 0 where a scaling is not finite.
fn set_shifts(shift: &mut [f64], x: &[f64]) {
    for (shift, &x) in shift.iter_mut().zip(x) {
        *shift = if x.is_finite() { x } else { 0.0 };
    }
}

fn set_weights(scratch: &mut Vec<f64>, x: &[f64], shift: &[f64]) {
    scratch.clear();
    scratch.extend(x.iter().zip(shift).map(|(x, s)| (x - s).exp()));
}

/// `Σ values · weights[ids]` in four chains of fixed order.
fn gathered(values: &[f64], ids: &[u32], weights: &[f64]) -> f64 {
    let (value_groups, value_rest) = values.as_chunks::<4>();
    let (id_groups, id_rest) = ids.as_chunks::<4>();
    let mut acc = [0.0_f64; 4];
    for (value, id) in value_groups.iter().zip(id_groups) {
        for lane in 0..4 {
            acc[lane] = value[lane].mul_add(weights[id[lane] as usize], acc[lane]);
        }
    }
    let rest: f64 = value_rest.iter().zip(id_rest).map(|(v, &id)| v * weights[id as usize]).sum();
    (acc[0] + acc[2]) + (acc[1] + acc[3]) + rest
}

impl Kernel for SparseKernel<'_> {
    fn rows(&mut self, x: &[f64], out: &mut [f64]) {
        let (cost, inverse, out_len) = (self.cost, self.inverse, out.len());
        if !self.is_stored || outgrown(x, &self.col_shift) {
            out.par_iter_mut().enumerate().with_min_len(MIN_TASK).for_each(|(i, value)| {
                *value = log_sum(cost.row(i), x, inverse);
            });
            set_shifts(&mut self.col_shift, x);
            let negated: Vec<f64> = out.iter().map(|value| -value).collect();
            set_shifts(&mut self.row_shift, &negated);
            self.store();
            return;
        }
        set_weights(&mut self.scratch, x, &self.col_shift);
        let (values, weights, shift) = (&self.by_row, &self.scratch, &self.row_shift);
        let lost =
            out.par_iter_mut().enumerate().with_min_len(MIN_TASK).filter_map(|(i, value)| {
                let range = cost.row_starts[i]..cost.row_starts[i + 1];
                let sum = gathered(&values[range.clone()], &cost.cols[range.clone()], weights);
                let trusted = (1.0 / SAFE_SUM..=SAFE_SUM).contains(&sum);
                *value =
                    if trusted { sum.ln() - shift[i] } else { log_sum(cost.row(i), x, inverse) };
                (!trusted && !range.is_empty()).then_some(())
            });
        self.is_stored = lost.count() as f64 <= MAX_UNSAFE_SHARE * out_len as f64;
    }

    fn cols(&mut self, x: &[f64], out: &mut [f64]) {
        let (cost, inverse, out_len) = (self.cost, self.inverse, out.len());
        if !self.is_stored || outgrown(x, &self.row_shift) {
            out.par_iter_mut().enumerate().with_min_len(MIN_TASK).for_each(|(j, value)| {
                *value = log_sum(cost.col(j), x, inverse);
            });
            set_shifts(&mut self.row_shift, x);
            let negated: Vec<f64> = out.iter().map(|value| -value).collect();
            set_shifts(&mut self.col_shift, &negated);
            self.store();
            return;
        }
        set_weights(&mut self.scratch, x, &self.row_shift);
        let (values, weights, shift) = (&self.by_col, &self.scratch, &self.col_shift);
        let lost =
            out.par_iter_mut().enumerate().with_min_len(MIN_TASK).filter_map(|(j, value)| {
                let range = cost.col_starts[j]..cost.col_starts[j + 1];
                let sum = gathered(&values[range.clone()], &cost.rows[range.clone()], weights);
                let trusted = (1.0 / SAFE_SUM..=SAFE_SUM).contains(&sum);
                *value =
                    if trusted { sum.ln() - shift[j] } else { log_sum(cost.col(j), x, inverse) };
                (!trusted && !range.is_empty()).then_some(())
            });
        self.is_stored = lost.count() as f64 <= MAX_UNSAFE_SHARE * out_len as f64;
    }
}
