//! Least-squares cubic fits to samples at the frames' times, from running sums.

/// Highest power of time.
const DEGREE: usize = 3;

/// Polynomials up to degree 3 that are orthonormal over the frames' times. With fewer frames than
/// coefficients, the degree is lower.
#[derive(Debug)]
pub(super) struct Basis {
    /// `[DEGREE+1][frames]`; rows above the degree determined by the frames are zero.
    values: Vec<Vec<f64>>,
    /// Coefficients of each polynomial, lowest power first.
    powers: [[f64; DEGREE + 1]; DEGREE + 1],
}

impl Basis {
    pub(super) fn new(times: &[f64]) -> Self {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut values: Vec<Vec<f64>> = Vec::new();
        let mut powers = [[0.0; DEGREE + 1]; DEGREE + 1];
        for j in 0..=DEGREE {
            let exponent = i32::try_from(j).unwrap_or(0);
            let mut column: Vec<f64> = times.iter().map(|t| t.powi(exponent)).collect();
            powers[j][j] = 1.0;
            let before = dot(&column, &column).sqrt();
            // Applied twice for orthogonality up to rounding.
            for _ in 0..2 {
                for i in 0..j {
                    let share = dot(&column, &values[i]);
                    column.iter_mut().zip(&values[i]).for_each(|(c, v)| *c -= share * v);
                    for p in 0..=DEGREE {
                        powers[j][p] -= share * powers[i][p];
                    }
                }
            }
            let norm = dot(&column, &column).sqrt();
            // A power that depends linearly on lower ones, up to rounding, is dropped.
            let factor = if norm > 1e-9 * before { 1.0 / norm } else { 0.0 };
            for value in column.iter_mut().chain(&mut powers[j]) {
                *value *= factor;
            }
            values.push(column);
        }
        Self { values, powers }
    }

    /// Weight of a sample at frame `f` for each polynomial.
    pub(super) fn weights(&self, f: usize) -> [f64; DEGREE + 1] {
        [0, 1, 2, 3].map(|j| self.values[j][f])
    }

    /// Coefficients (lowest power first) of the best polynomial of at most `degree`, from the sums
    /// of samples times weights.
    pub(super) fn coefficients(&self, sums: [f64; DEGREE + 1], degree: usize) -> [f64; DEGREE + 1] {
        [0, 1, 2, 3].map(|p| (0..=degree).map(|j| sums[j] * self.powers[j][p]).sum())
    }
}

/// The same polynomial in powers of `t − centre`.
pub(super) fn shifted([a, b, c, d]: [f64; 4], centre: f64) -> [f64; 4] {
    [
        a + centre * (b + centre * (c + centre * d)),
        b + centre * (2.0 * c + centre * 3.0 * d),
        c + 3.0 * d * centre,
        d,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(times: &[f64], degree: usize, f: impl Fn(f64) -> f64) -> [f64; 4] {
        let basis = Basis::new(times);
        let mut sums = [0.0; 4];
        for (i, &t) in times.iter().enumerate() {
            for (sum, weight) in sums.iter_mut().zip(basis.weights(i)) {
                *sum += weight * f(t);
            }
        }
        basis.coefficients(sums, degree)
    }

    #[test]
    fn cubics_are_recovered_exactly() {
        let times: Vec<f64> = (0..20_i32).map(|i| f64::from(i) / 19.0 - 0.5).collect();
        let found = fit(&times, 3, |t| 3.0 - 2.0 * t + 5.0 * t * t - 7.0 * t * t * t);
        for (found, expected) in found.into_iter().zip([3.0, -2.0, 5.0, -7.0]) {
            assert!((found - expected).abs() < 1e-11, "{found} for {expected}");
        }
        let line = fit(&times, 1, |t| 1.0 + 4.0 * t);
        assert!((line[1] - 4.0).abs() < 1e-12 && line[2..] == [0.0; 2], "{line:?}");
    }

    #[test]
    fn few_frames_lower_the_degree() {
        for count in 1..4_i32 {
            let times: Vec<f64> = (0..count).map(|i| f64::from(i) / 3.0).collect();
            let found = fit(&times, 3, |t| 2.0 + t * t);
            assert!(found.iter().all(|c| c.is_finite()), "{count}: {found:?}");
            for t in times {
                let value = shifted(found, t)[0];
                assert!((value - (2.0 + t * t)).abs() < 1e-12, "through its samples: {value}");
            }
        }
    }

    #[test]
    fn shifting_keeps_the_polynomial() {
        let p = [1.0, -2.0, 3.0, 0.5];
        let q = shifted(p, 0.7);
        let at = |p: [f64; 4], t: f64| p[0] + t * (p[1] + t * (p[2] + t * p[3]));
        for t in [-1.0, 0.0, 0.4, 2.0] {
            assert!((at(p, t) - at(q, t - 0.7)).abs() < 1e-12, "at {t}");
        }
    }
}
