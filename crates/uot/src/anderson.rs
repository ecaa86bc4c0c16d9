//! Anderson mixing for a fixed-point map `x ← T(x)`.

/// Number of stored differences. Fewer need more sweeps (4: up to half as many more); each costs
/// two vectors of memory.
const DEPTH: usize = 12;
/// Maximum step of any coordinate (logarithm of a scaling).
const MAX_STEP: f64 = 3.0;
/// Ratio of the residual to the best one at which the history is discarded.
const RESTART_GROWTH: f64 = 5.0;

/// History of iterates and residuals.
#[derive(Debug, Default)]
pub(crate) struct Anderson {
    previous: Option<(Vec<f64>, Vec<f64>)>,
    /// Differences of consecutive `T(x)` and of consecutive residuals `T(x) − x`, oldest first.
    images: Vec<Vec<f64>>,
    residuals: Vec<Vec<f64>>,
    /// Scalar products of the residual differences.
    gram: Vec<Vec<f64>>,
    best: f64,
}

impl Anderson {
    pub(crate) fn new() -> Self {
        Self { best: f64::INFINITY, ..Self::default() }
    }

    /// Replaces `x` by the mixed iterate, given `image = T(x)` and the largest residual.
    pub(crate) fn step(&mut self, x: &mut [f64], image: &[f64], worst: f64) {
        if worst > RESTART_GROWTH * self.best {
            *self = Self::new();
        }
        self.best = self.best.min(worst);
        let residual: Vec<f64> = image.iter().zip(x.iter()).map(|(t, x)| t - x).collect();
        if let Some((last_image, last_residual)) = self.previous.take() {
            let d_image = difference(image, last_image);
            let d_residual = difference(&residual, last_residual);
            self.push(d_image, d_residual);
        }
        let gamma = self.weights(&residual);
        let mut next = image.to_vec();
        for (weight, d_image) in gamma.iter().zip(&self.images) {
            for (value, d) in next.iter_mut().zip(d_image) {
                *value -= weight * d;
            }
        }
        let longest =
            next.iter().zip(x.iter()).map(|(new, old)| (new - old).abs()).fold(0.0, f64::max);
        self.previous = Some((image.to_vec(), residual));
        let scale = if longest > MAX_STEP { MAX_STEP / longest } else { 1.0 };
        if longest.is_finite() {
            for (old, new) in x.iter_mut().zip(next) {
                *old += scale * (new - *old);
            }
        } else {
            x.copy_from_slice(image);
            *self = Self::new();
        }
    }

    fn push(&mut self, d_image: Vec<f64>, d_residual: Vec<f64>) {
        if self.images.len() == DEPTH {
            self.images.remove(0);
            self.residuals.remove(0);
            self.gram.remove(0);
            self.gram.iter_mut().for_each(|row| {
                row.remove(0);
            });
        }
        let products: Vec<f64> =
            self.residuals.iter().map(|other| dot(other, &d_residual)).collect();
        for (row, &product) in self.gram.iter_mut().zip(&products) {
            row.push(product);
        }
        let own = dot(&d_residual, &d_residual);
        self.gram.push(products.into_iter().chain([own]).collect());
        self.images.push(d_image);
        self.residuals.push(d_residual);
    }

    /// Least-squares weights of the residual differences, newest first in the elimination: a
    /// difference that is numerically dependent on newer ones gets weight zero.
    fn weights(&self, residual: &[f64]) -> Vec<f64> {
        let k = self.gram.len();
        let mut gamma = vec![0.0; k];
        let scale: Vec<f64> = (0..k)
            .map(|i| if self.gram[i][i] > 0.0 { self.gram[i][i].sqrt().recip() } else { 0.0 })
            .collect();
        let order: Vec<usize> = (0..k).rev().filter(|&i| scale[i] > 0.0).collect();
        // Cholesky of the matrix with unit diagonal, skipping dependent columns
        let mut kept: Vec<usize> = Vec::with_capacity(k);
        let mut factor: Vec<Vec<f64>> = Vec::with_capacity(k);
        let mut rhs: Vec<f64> = Vec::with_capacity(k);
        for &i in &order {
            let mut row: Vec<f64> = Vec::with_capacity(kept.len() + 1);
            for (p, &j) in kept.iter().enumerate() {
                let mut value = self.gram[i][j] * scale[i] * scale[j];
                for q in 0..p {
                    value -= row[q] * factor[p][q];
                }
                row.push(value / factor[p][p]);
            }
            let pivot = 1.0 - row.iter().map(|v| v * v).sum::<f64>();
            if pivot > 1e-13 {
                let target = dot(&self.residuals[i], residual) * scale[i]
                    - row.iter().zip(&rhs).map(|(v, r)| v * r).sum::<f64>();
                row.push(pivot.sqrt());
                rhs.push(target / pivot.sqrt());
                factor.push(row);
                kept.push(i);
            }
        }
        for p in (0..kept.len()).rev() {
            let mut value = rhs[p];
            for q in p + 1..kept.len() {
                value -= factor[q][p] * gamma[kept[q]];
            }
            gamma[kept[p]] = value / factor[p][p];
        }
        for (g, s) in gamma.iter_mut().zip(&scale) {
            *g *= s;
        }
        gamma
    }
}

fn difference(new: &[f64], mut old: Vec<f64>) -> Vec<f64> {
    for (old, new) in old.iter_mut().zip(new) {
        *old = new - *old;
    }
    old
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    let (x_groups, x_rest) = x.as_chunks::<8>();
    let (y_groups, y_rest) = y.as_chunks::<8>();
    let mut acc = [0.0; 8];
    for (x, y) in x_groups.iter().zip(y_groups) {
        for lane in 0..8 {
            acc[lane] += x[lane] * y[lane];
        }
    }
    let rest: f64 = x_rest.iter().zip(y_rest).map(|(x, y)| x * y).sum();
    crate::simd::fold(acc) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_map_is_solved_in_dimension_plus_two_steps() {
        let image =
            |x: &[f64]| vec![0.9 * x[0] + 0.3, -0.5 * x[1] + 0.2 * x[0], 0.99 * x[2] + 0.01];
        let mut x = vec![0.0; 3];
        let mut anderson = Anderson::new();
        for _ in 0..6 {
            let t = image(&x);
            let worst =
                t.iter().zip(&x).map(|(t, x): (&f64, &f64)| (t - x).abs()).fold(0.0, f64::max);
            anderson.step(&mut x, &t, worst);
        }
        assert!((x[0] - 3.0).abs() < 1e-9 && (x[1] - 0.4).abs() < 1e-9, "{x:?}");
        assert!((x[2] - 1.0).abs() < 1e-9, "{x:?}");
    }

    #[test]
    fn the_identity_map_gives_no_step() {
        let mut x = vec![1.0, 2.0];
        let mut anderson = Anderson::new();
        for _ in 0..4 {
            let image = x.clone();
            anderson.step(&mut x, &image, 0.0);
        }
        assert_eq!(x, vec![1.0, 2.0], "no residual, no step");
    }
}
