//! Kernels of an explicit cost matrix: stored exponentials, or logarithms throughout when those
//! would underflow.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use super::gibbs::{Kernel, chunk_len, largest};
use crate::simd::{LANES, Lane, dispatch, exp, exp_shifted, fold};
use rayon::prelude::*;

/// Largest `(max D − min D)/λ0` for which products of kernel and scalings stay far from the limits
/// of f64.
pub(crate) const MAX_SCALED_RANGE: f64 = 200.0;

/// Stored `exp(−(D − min D)/λ0)`.
#[derive(Debug)]
pub(crate) struct DenseKernel {
    values: Vec<f64>,
    num_cols: usize,
    /// `−min D/λ0`, added to every result.
    offset: f64,
    row_scratch: Vec<f64>,
    col_scratch: Vec<f64>,
}

impl DenseKernel {
    /// `cost` is `[n, m]` row-major with smallest entry `smallest`.
    pub(crate) fn new(cost: &[f64], num_cols: usize, smallest: f64, lambda_ent: f64) -> Self {
        let mut values = vec![0.0; cost.len()];
        let inverse = lambda_ent.recip();
        values.par_chunks_mut(1 << 14).zip(cost.par_chunks(1 << 14)).for_each(|(out, cost)| {
            dispatch(
                #[inline(always)]
                || {
                    for (o, &d) in out.iter_mut().zip(cost) {
                        *o = exp((smallest - d) * inverse);
                    }
                },
            );
        });
        let num_rows = cost.len() / num_cols;
        Self {
            values,
            num_cols,
            offset: -smallest * inverse,
            row_scratch: vec![0.0; num_rows],
            col_scratch: vec![0.0; num_cols],
        }
    }
}

impl Kernel for DenseKernel {
    fn rows(&mut self, x: &[f64], out: &mut [f64]) {
        let shift = largest(x);
        exp_shifted(x, shift, &mut self.col_scratch);
        let (values, x, m) = (&self.values, &self.col_scratch, self.num_cols);
        let rows = chunk_len(out.len(), (1 << 14) / m + 1);
        let back = shift + self.offset;
        out.par_chunks_mut(rows).zip(values.par_chunks(rows * m)).for_each(|(out, values)| {
            dispatch(
                #[inline(always)]
                || {
                    for (value, row) in out.iter_mut().zip(values.chunks_exact(m)) {
                        *value = dot(row, x).ln() + back;
                    }
                },
            );
        });
    }

    fn cols(&mut self, x: &[f64], out: &mut [f64]) {
        let shift = largest(x);
        exp_shifted(x, shift, &mut self.row_scratch);
        let (values, x, m) = (&self.values, &self.row_scratch, self.num_cols);
        let rows = chunk_len(x.len(), (1 << 14) / m + 1);
        let partial: Vec<Vec<f64>> = values
            .par_chunks(rows * m)
            .zip(x.par_chunks(rows))
            .map(|(values, x)| {
                let mut acc = vec![0.0; m];
                dispatch(
                    #[inline(always)]
                    || {
                        for (row, &scale) in values.chunks_exact(m).zip(x) {
                            for (a, &k) in acc.iter_mut().zip(row) {
                                *a = k.mul_add(scale, *a);
                            }
                        }
                    },
                );
                acc
            })
            .collect();
        out.fill(0.0);
        for acc in &partial {
            for (o, a) in out.iter_mut().zip(acc) {
                *o += a;
            }
        }
        let back = shift + self.offset;
        for value in out {
            *value = value.ln() + back;
        }
    }
}

#[inline(always)]
fn dot(row: &[f64], x: &[f64]) -> f64 {
    let (row_groups, row_rest) = row.as_chunks::<{ 4 * LANES }>();
    let (x_groups, x_rest) = x.as_chunks::<{ 4 * LANES }>();
    let mut acc = [0.0; 4 * LANES];
    for (k, x) in row_groups.iter().zip(x_groups) {
        for lane in 0..4 * LANES {
            acc[lane] = k[lane].mul_add(x[lane], acc[lane]);
        }
    }
    let mut lanes: Lane = [0.0; LANES];
    for lane in 0..LANES {
        lanes[lane] =
            (acc[lane] + acc[lane + LANES]) + (acc[lane + 2 * LANES] + acc[lane + 3 * LANES]);
    }
    let rest: f64 = row_rest.iter().zip(x_rest).map(|(k, x)| k * x).sum();
    fold(lanes) + rest
}

/// Log-sum-exp straight from the cost; one exponential per entry and product.
#[derive(Debug)]
pub(crate) struct LogDenseKernel<'a> {
    cost: &'a [f64],
    num_cols: usize,
    inverse_lambda: f64,
}

impl<'a> LogDenseKernel<'a> {
    pub(crate) fn new(cost: &'a [f64], num_cols: usize, lambda_ent: f64) -> Self {
        Self { cost, num_cols, inverse_lambda: lambda_ent.recip() }
    }
}

/// Columns that one task of [`LogDenseKernel::cols`] takes: eight cache lines of every row.
const STRIPE: usize = 64;

impl Kernel for LogDenseKernel<'_> {
    fn rows(&mut self, x: &[f64], out: &mut [f64]) {
        let (m, inverse) = (self.num_cols, self.inverse_lambda);
        let rows = chunk_len(out.len(), (1 << 12) / m + 1);
        out.par_chunks_mut(rows).zip(self.cost.par_chunks(rows * m)).for_each(|(out, cost)| {
            let mut terms = vec![0.0; m];
            dispatch(
                #[inline(always)]
                || {
                    for (value, row) in out.iter_mut().zip(cost.chunks_exact(m)) {
                        for ((t, &x), &d) in terms.iter_mut().zip(x).zip(row) {
                            *t = d.mul_add(-inverse, x);
                        }
                        let top = largest(&terms);
                        let total: f64 = terms.iter().map(|&t| exp(t - top)).sum();
                        *value = top + total.ln();
                    }
                },
            );
        });
    }

    fn cols(&mut self, x: &[f64], out: &mut [f64]) {
        let (m, inverse, cost) = (self.num_cols, self.inverse_lambda, self.cost);
        out.par_chunks_mut(STRIPE).enumerate().for_each(|(k, out)| {
            let range = k * STRIPE..k * STRIPE + out.len();
            dispatch(
                #[inline(always)]
                || {
                    let mut top = [f64::NEG_INFINITY; STRIPE];
                    let mut total = [0.0; STRIPE];
                    for (row, &x) in cost.chunks_exact(m).zip(x) {
                        for (t, &d) in top.iter_mut().zip(&row[range.clone()]) {
                            *t = t.max(d.mul_add(-inverse, x));
                        }
                    }
                    for (row, &x) in cost.chunks_exact(m).zip(x) {
                        for ((s, &t), &d) in total.iter_mut().zip(&top).zip(&row[range.clone()]) {
                            *s += exp(d.mul_add(-inverse, x) - t);
                        }
                    }
                    for ((value, &t), &s) in out.iter_mut().zip(&top).zip(&total) {
                        *value = t + s.ln();
                    }
                },
            );
        });
    }
}
