//! Noise that scripts in other languages can reproduce.

/// A linear congruential generator of values in [0, 1), as in the scripts that made the fixtures of
/// the image metrics.
#[derive(Debug, Clone)]
pub struct Lcg(pub u32);

impl Lcg {
    /// The next value.
    pub fn sample(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0 >> 8) / f64::from(1_u32 << 24)
    }

    /// The next `len` values.
    pub fn take(&mut self, len: usize) -> Vec<f64> {
        (0..len).map(|_| self.sample()).collect()
    }

    /// `values`, each blended with a share `noise` of the next values.
    pub fn disturb(&mut self, values: &[f64], noise: f64) -> Vec<f64> {
        values.iter().map(|value| (1.0 - noise) * value + noise * self.sample()).collect()
    }
}

/// A noise image `[H,W,C]` of values in [0, 1), and the same image blended with a share `noise` of
/// more noise.
pub fn noise_pair([width, height, channels]: [usize; 3], seed: u32, noise: f64) -> [Vec<f64>; 2] {
    let mut lcg = Lcg(seed);
    let first = lcg.take(width * height * channels);
    let second = lcg.disturb(&first, noise);
    [first, second]
}
