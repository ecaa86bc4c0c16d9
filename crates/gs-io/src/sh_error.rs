//! [`ShError`]: colour error of rounded SH coefficients.

/// Colour error of rounded SH coefficients over many splats, in steps of 1/255.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ShError {
    /// Sum over splats and channels of the mean square over all directions.
    sum: f64,
    /// Largest bound on the error of a splat in any direction.
    most: f64,
    count: u64,
}

impl ShError {
    /// Adds a splat: its coefficients above degree 0, and those read back. Missing ones are zeros.
    pub(crate) fn add(&mut self, written: &[[f32; 3]], read: &[[f32; 3]]) {
        let coeffs = written.len().max(read.len());
        let of = |sh: &[[f32; 3]], k: usize, channel: usize| {
            sh.get(k).map_or(0.0, |rgb| f64::from(rgb[channel]))
        };
        // The basis is orthonormal: the mean square over directions is Σδ²/4π. In any direction ΣY²
        // over degrees 1 to L is ((L+1)²−1)/4π, so the error is at most the square root of Σδ²
        // times that (Cauchy-Schwarz).
        for channel in 0..3 {
            let square: f64 =
                (0..coeffs).map(|k| (of(written, k, channel) - of(read, k, channel)).powi(2)).sum();
            let mean = square / (4.0 * std::f64::consts::PI);
            if mean.is_finite() {
                self.sum += mean;
                self.count += 1;
                self.most = self.most.max((mean * coeffs as f64).sqrt());
            }
        }
    }

    /// "… steps of 1/255 (root mean square), at most …", for a sentence.
    pub(crate) fn in_steps(&self) -> String {
        let rms = (self.sum / self.count.max(1) as f64).sqrt();
        format!(
            "{:.2} steps of 1/255 (root mean square over splats and views; at most {:.1})",
            255.0 * rms,
            255.0 * self.most
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::sh;

    #[test]
    fn equals_the_measured_error_of_colours() {
        let written = [[0.1, 0.0, 0.0], [-0.2, 0.0, 0.0], [0.05, 0.0, 0.0]];
        let mut error = ShError::default();
        error.add(&written, &[]);
        let mut largest = 0.0_f64;
        let (mut square, mut count) = (0.0, 0.0);
        // An equal-area grid of height and longitude.
        for i in 0..200 {
            for j in 0..200 {
                let z = (f64::from(i) + 0.5) / 100.0 - 1.0;
                let angle = std::f64::consts::TAU * f64::from(j) / 200.0;
                let radius = (1.0 - z * z).sqrt();
                let basis = sh::basis(1, [radius * angle.cos(), radius * angle.sin(), z]);
                let off: f64 = (0..3).map(|k| f64::from(written[k][0]) * basis[k + 1]).sum();
                largest = largest.max(off.abs());
                square += off * off;
                count += 1.0;
            }
        }
        // Two of the three channels are exact.
        let rms = (square / count / 3.0_f64).sqrt();
        assert!((rms - (error.sum / 3.0).sqrt()).abs() < 1e-4, "{rms} {error:?}");
        assert!((largest - error.most).abs() < 1e-3, "{largest} {error:?}");
    }
}
