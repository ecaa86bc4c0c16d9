//! Adam.

use gs_core::Real;

/// Adam (Kingma & Ba 2015) over some rows of parameters, with a rate per column.
///
/// Parameters are `[rows, columns]`, flat. A rate of 0 freezes a column. Rows that a step does
/// not list keep their values and moments, bit for bit.
#[derive(Debug, Clone, PartialEq)]
pub struct Adam<F> {
    /// Decay of the first moment. Default 0.9.
    pub beta1: F,
    /// Decay of the second moment. Default 0.999.
    pub beta2: F,
    /// Added to the root of the second moment. Default 1e-15, as in 3DGS.
    pub epsilon: F,
    /// Number of steps so far.
    pub step: u64,
    /// First moments, `[rows, columns]`.
    pub m: Vec<F>,
    /// Second moments, `[rows, columns]`.
    pub v: Vec<F>,
}

impl<F: Real> Adam<F> {
    /// Zero moments for `len` parameters.
    pub fn new(len: usize) -> Self {
        Self {
            beta1: F::of(0.9),
            beta2: F::of(0.999),
            epsilon: F::of(1e-15),
            step: 0,
            m: vec![F::zero(); len],
            v: vec![F::zero(); len],
        }
    }

    /// One step along the negative gradient. `rates` has one learning rate per column. `rows` lists
    /// the rows that change: the row of `params`, and its row of `grads`.
    ///
    /// # Panics
    /// If a length or a row does not fit.
    pub fn step(
        &mut self,
        params: &mut [F],
        grads: &[F],
        rates: &[F],
        rows: impl Iterator<Item = [usize; 2]>,
    ) {
        let len = self.m.len();
        let columns = rates.len();
        assert!(
            params.len() == len && len.is_multiple_of(columns.max(1)),
            "adam: {} parameters, {columns} rates, made for {len}",
            params.len(),
        );
        self.step += 1;
        let exponent = i32::try_from(self.step).unwrap_or(i32::MAX);
        let correct1 = F::one() - self.beta1.powi(exponent);
        let correct2 = F::one() - self.beta2.powi(exponent);
        for [row, grad] in rows {
            let own = row * columns..(row + 1) * columns;
            let values = params[own.clone()].iter_mut().zip(rates);
            let moments = self.m[own.clone()].iter_mut().zip(&mut self.v[own]);
            let grads = &grads[grad * columns..(grad + 1) * columns];
            for (((param, &rate), (m, v)), &g) in values.zip(moments).zip(grads) {
                *m = self.beta1 * *m + (F::one() - self.beta1) * g;
                *v = self.beta2 * *v + (F::one() - self.beta2) * g * g;
                let scale = (*v / correct2).sqrt() + self.epsilon;
                *param -= rate * (*m / correct1) / scale;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first step is `rate · sign(g)` for any scale; later ones follow the recurrence, written
    /// out here.
    #[test]
    fn follows_the_recurrence() {
        let mut adam = Adam::<f64>::new(1);
        let mut x = [1.0];
        let (mut m, mut v) = (0.0, 0.0);
        let mut expected = 1.0_f64;
        for (i, g) in [0.5, -2.0, 0.1].into_iter().enumerate() {
            adam.step(&mut x, &[g], &[0.1], std::iter::once([0, 0]));
            m = 0.9 * m + 0.1 * g;
            v = f64::from(0.999_f32) * v + (1.0 - f64::from(0.999_f32)) * g * g;
            let n = i32::try_from(i + 1).unwrap();
            let (mh, vh) = (m / (1.0 - 0.9_f64.powi(n)), v / (1.0 - f64::from(0.999_f32).powi(n)));
            expected -= 0.1 * mh / vh.sqrt();
            assert!((x[0] - expected).abs() < 1e-6, "step {n}: {} {expected}", x[0]);
        }
    }

    #[test]
    fn skipped_rows_and_frozen_columns_do_not_change() {
        let mut adam = Adam::<f32>::new(4);
        let mut x = [1.0, 2.0, 3.0, 4.0];
        adam.step(&mut x, &[1.0; 2], &[0.1, 0.0], std::iter::once([1, 0]));
        assert_eq!(x[..2], [1.0, 2.0], "skipped row");
        assert_eq!(x[3], 4.0, "frozen column");
        assert!(x[2] < 3.0 && adam.m[0] == 0.0, "the rest changes");
    }
}
