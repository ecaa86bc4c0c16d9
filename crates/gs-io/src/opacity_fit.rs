//! Least-squares fit of opacity over time: `α·exp(−((t − centre)/width)²)`, or constant.

/// Width of splats that do not fade: nearly the largest half-precision number.
pub(crate) const ALWAYS: f64 = 1e4;

/// Opacities at most this large are ignored in the fit.
const MIN_OPACITY: f64 = 1e-4;

/// Running sums of one splat's opacities.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    count: f64,
    total: f64,
    /// `Σ α²·tᵏ`; the weights α² make the fit minimise errors of the opacity, not of its logarithm.
    moments: [f64; 5],
    /// `Σ α²·tᵏ·ln α`.
    logs: [f64; 3],
    /// `Σ α²·(ln α)²`.
    square: f64,
}

/// A fitted opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fade {
    pub(crate) opacity: f64,
    /// In the time of the samples.
    pub(crate) centre: f64,
    pub(crate) width: f64,
}

impl Sums {
    pub(crate) fn add(&mut self, t: f64, opacity: f64) {
        self.count += 1.0;
        self.total += opacity;
        let opacity = opacity.max(MIN_OPACITY);
        let (weight, log) = (opacity * opacity, opacity.ln());
        let mut power = weight;
        for k in 0..5 {
            self.moments[k] += power;
            if k < 3 {
                self.logs[k] += power * log;
            }
            power *= t;
        }
        self.square += weight * log * log;
    }

    /// The Gaussian in time if it fits the opacities clearly
    /// better than a constant, else their mean.
    pub(crate) fn fit(&self) -> Fade {
        let constant =
            Fade { opacity: self.total / self.count.max(1.0), centre: 0.0, width: ALWAYS };
        let [m0, ..] = self.moments;
        let unexplained = |explained: f64| (self.square - explained).max(0.0) / m0;
        let spread = unexplained(self.logs[0] * self.logs[0] / m0);
        // Changes below about one percent are ignored.
        if spread < 1e-4 {
            return constant;
        }
        let Some([a, b, c]) = self.parabola() else { return constant };
        let left = unexplained(a * self.logs[0] + b * self.logs[1] + c * self.logs[2]);
        let centre = -0.5 * b / c;
        let opacity = (a - 0.25 * b * b / c).exp();
        let usable = c < 0.0 && centre.abs() <= 1.0 && opacity <= 1.5 && left < 0.5 * spread;
        if usable { Fade { opacity, centre, width: (-c).sqrt().recip() } } else { constant }
    }

    /// Weighted least-squares parabola through the logarithms, lowest power first.
    fn parabola(&self) -> Option<[f64; 3]> {
        let [m0, m1, m2, m3, m4] = self.moments;
        let [l0, l1, l2] = self.logs;
        // Inverse of the symmetric matrix of moments by cofactors.
        let c00 = m2 * m4 - m3 * m3;
        let c01 = m2 * m3 - m1 * m4;
        let c02 = m1 * m3 - m2 * m2;
        let c11 = m0 * m4 - m2 * m2;
        let c12 = m1 * m2 - m0 * m3;
        let c22 = m0 * m2 - m1 * m1;
        let determinant = m0 * c00 + m1 * c01 + m2 * c02;
        // A parabola needs at least three times with significant weight.
        (determinant > 1e-9 * m0 * m2 * m4).then(|| {
            [
                (c00 * l0 + c01 * l1 + c02 * l2) / determinant,
                (c01 * l0 + c11 * l1 + c12 * l2) / determinant,
                (c02 * l0 + c12 * l1 + c22 * l2) / determinant,
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(opacity: impl Fn(f64) -> f64) -> Fade {
        let mut sums = Sums::default();
        for i in 0..30_i32 {
            let t = f64::from(i) / 29.0 - 0.5;
            sums.add(t, opacity(t));
        }
        sums.fit()
    }

    #[test]
    fn gaussians_are_recovered() {
        for (centre, width) in [(0.0, 0.3), (-0.4, 0.15), (0.6, 0.5)] {
            let found = fit(|t| 0.8 * (-((t - centre) / width).powi(2)).exp());
            assert!((found.centre - centre).abs() < 0.02, "{found:?}, centre {centre}");
            assert!((found.width - width).abs() < 0.02, "{found:?}, width {width}");
            assert!((found.opacity - 0.8).abs() < 0.02, "{found:?}");
        }
    }

    #[test]
    fn other_opacities_are_fitted_by_a_constant() {
        assert_eq!(fit(|_| 0.4).width, ALWAYS, "constant");
        assert!((fit(|_| 0.4).opacity - 0.4).abs() < 1e-12, "its value");
        assert_eq!(fit(|t| 0.3 + 0.5 * t * t).width, ALWAYS, "fading out in the middle");
        assert_eq!(fit(|_| 0.0).opacity, 0.0, "invisible");
    }
}
