//! [`NormalEquations`]: every splat's SH as a weighted least-squares fit of observed colours.

use crate::{Entry, RegressionParams};
use gs_core::sh;
use rayon::prelude::*;

/// Rows per task.
const CHUNK: usize = 512;

/// Observation of one splat in one image: change of colour (RGB, before the clamp at 0) and weight;
/// weight 0 means none.
pub(crate) type Observation = [f32; 4];

/// Normal equations of the fits of all splats.
#[derive(Clone)]
pub(crate) struct NormalEquations {
    coeffs: usize,
    /// `Σ w Y Yᵀ`, lower triangles, `[E, K(K+1)/2]`.
    pub(crate) gram: Vec<f64>,
    /// `Σ w Y τ`, `[E, K, 3]`.
    pub(crate) right: Vec<f64>,
}

impl NormalEquations {
    pub(crate) fn new(rows: usize, coeffs: usize) -> Self {
        let gram = vec![0.0; rows * coeffs * (coeffs + 1) / 2];
        Self { coeffs, gram, right: vec![0.0; rows * coeffs * 3] }
    }

    pub(crate) fn clear(&mut self) {
        self.gram.fill(0.0);
        self.right.fill(0.0);
    }

    /// Adds the observations of one image. Entries are ascending by row, each row at most once.
    pub(crate) fn add(&mut self, degree: usize, entries: &[Entry], observations: &[Observation]) {
        let coeffs = self.coeffs;
        let triangle = coeffs * (coeffs + 1) / 2;
        let grams = self.gram.par_chunks_mut(CHUNK * triangle);
        let rights = self.right.par_chunks_mut(CHUNK * coeffs * 3);
        grams.zip(rights).enumerate().for_each(|(chunk, (gram, right))| {
            let first = chunk * CHUNK;
            let begin = entries.partition_point(|entry| (entry.row as usize) < first);
            let end = entries.partition_point(|entry| (entry.row as usize) < first + CHUNK);
            for (entry, observation) in entries[begin..end].iter().zip(&observations[begin..end]) {
                let [red, green, blue, weight] = observation.map(f64::from);
                if weight == 0.0 {
                    continue;
                }
                let row = entry.row as usize - first;
                let gram = &mut gram[row * triangle..(row + 1) * triangle];
                let right = &mut right[row * coeffs * 3..(row + 1) * coeffs * 3];
                let basis = sh::basis(degree, entry.towards.map(f64::from));
                let mut at = 0;
                for i in 0..coeffs {
                    let scaled = weight * basis[i];
                    for (sum, other) in gram[at..=at + i].iter_mut().zip(basis) {
                        *sum += scaled * other;
                    }
                    at += i + 1;
                    for (channel, value) in [red, green, blue].into_iter().enumerate() {
                        right[i * 3 + channel] += scaled * value;
                    }
                }
            }
        });
    }

    /// Solves the rows that have at least one observation. `anchor_weights[row]` is the weight of
    /// the terms that keep the row at its colour in the edited frame; it does not strengthen the
    /// prior.
    pub(crate) fn solve(
        &self,
        params: &RegressionParams,
        base: &[[f32; 3]],
        uncertain_shares: &[f32],
        anchor_weights: &[f64],
        d_sh: &mut [[f32; 3]],
    ) {
        let coeffs = self.coeffs;
        let triangle = coeffs * (coeffs + 1) / 2;
        d_sh.par_chunks_mut(coeffs).with_min_len(CHUNK).enumerate().for_each(|(row, out)| {
            let gram = &self.gram[row * triangle..(row + 1) * triangle];
            // Y₀ is constant, so this entry is its square times the total weight
            let total = gram[0] / f64::from(sh::C0 * sh::C0);
            if total.is_nan() || total <= 0.0 {
                return;
            }
            let observed_weight = (total - anchor_weights[row]).max(0.0);
            let (mut ridge, mut right) = ([0.0; 16], [0.0; 48]);
            right[..coeffs * 3].copy_from_slice(&self.right[row * coeffs * 3..][..coeffs * 3]);
            ridge[0] = observed_weight * params.prior * 1e-3 + total * CONDITIONING;
            for k in 1..coeffs {
                let degree = k.isqrt() as f64;
                let smooth = observed_weight
                    * params.prior
                    * degree
                    * degree
                    * f64::from(uncertain_shares[row]);
                ridge[k] = smooth + total * CONDITIONING;
                // the ridge applies to the coefficients, not to their change
                for channel in 0..3 {
                    let stored = f64::from(base[row * coeffs + k][channel]);
                    right[k * 3 + channel] -= smooth * stored;
                }
            }
            if let Some(solution) = cholesky_solve(gram, right, &ridge, coeffs) {
                for (k, rgb) in out.iter_mut().enumerate() {
                    for channel in 0..3 {
                        #[expect(clippy::cast_possible_truncation, reason = "coefficients are f32")]
                        let value = solution[k * 3 + channel] as f32;
                        rgb[channel] = value;
                    }
                }
            }
        });
    }
}

/// Ridge on every change, relative to the total weight. It keeps colours in unobserved directions
/// unchanged.
const CONDITIONING: f64 = 1e-6;

/// Solves `(gram + diag(ridge))·X = x` for three right-hand sides `x`; `None` if the system is not
/// positive definite.
fn cholesky_solve(
    gram: &[f64],
    mut x: [f64; 48],
    ridge: &[f64; 16],
    coeffs: usize,
) -> Option<[f64; 48]> {
    let mut factor = [0.0_f64; 136];
    let start = |row: usize| row * (row + 1) / 2;
    for i in 0..coeffs {
        for j in 0..=i {
            let mut sum = gram[start(i) + j];
            if i == j {
                sum += ridge[i];
            }
            for k in 0..j {
                sum -= factor[start(i) + k] * factor[start(j) + k];
            }
            if i == j {
                if sum.is_nan() || sum <= 0.0 {
                    return None;
                }
                factor[start(i) + i] = sum.sqrt();
            } else {
                factor[start(i) + j] = sum / factor[start(j) + j];
            }
        }
    }
    for channel in 0..3 {
        for i in 0..coeffs {
            let mut sum = x[i * 3 + channel];
            for k in 0..i {
                sum -= factor[start(i) + k] * x[k * 3 + channel];
            }
            x[i * 3 + channel] = sum / factor[start(i) + i];
        }
        for i in (0..coeffs).rev() {
            let mut sum = x[i * 3 + channel];
            for k in i + 1..coeffs {
                sum -= factor[start(k) + i] * x[k * 3 + channel];
            }
            x[i * 3 + channel] = sum / factor[start(i) + i];
        }
    }
    x[..coeffs * 3].iter().all(|value| value.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fit_recovers_coefficients_from_enough_directions() {
        let (degree, coeffs) = (3, 16);
        let truth: Vec<[f32; 3]> =
            (0..coeffs).map(|k| [0.1 * k as f32, 0.5 - 0.03 * k as f32, 0.2]).collect();
        let mut normals = NormalEquations::new(2, coeffs);
        for k in 0..60 {
            // a spiral over the sphere
            let z = 1.0 - 2.0 * (k as f32 + 0.5) / 60.0;
            let (sin, cos) = (2.4 * k as f32).sin_cos();
            let towards = [(1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z];
            let entry = Entry { local: 0, row: 1, towards, color: [0.0; 3], is_constrained: true };
            let [r, g, b] = sh::color(degree, &truth, towards).map(|value| value - 0.5);
            let observation = [r, g, b, 0.5 + (k % 3) as f32];
            normals.add(degree, &[entry], &[observation]);
        }
        let mut d_sh = vec![[0.0; 3]; 2 * coeffs];
        let params = RegressionParams { prior: 0.0, ..RegressionParams::default() };
        normals.solve(&params, &vec![[0.0; 3]; 2 * coeffs], &[1.0; 2], &[0.0; 2], &mut d_sh);
        for (ours, theirs) in d_sh[coeffs..].iter().zip(&truth) {
            for channel in 0..3 {
                assert!((ours[channel] - theirs[channel]).abs() < 1e-3, "{ours:?} {theirs:?}");
            }
        }
        assert!(d_sh[..coeffs].iter().all(|rgb| *rgb == [0.0; 3]), "row 0 has no observations");
    }
}
