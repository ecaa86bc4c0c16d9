//! Random numbers that do not depend on the version of a library: [`SplitMix64`],
//! [`standard_normal`].

use crate::Real;

/// Generator with 64 bits of state (Steele, Lea and Flood 2014). Equal seeds give equal sequences
/// in every version of this workspace.
#[derive(Debug, Clone, Copy)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// Increment of the state: the golden ratio in 64 bits.
    pub const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

    /// Starts the sequence of `seed`.
    #[inline]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    #[inline]
    pub const fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(Self::GOLDEN);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// The next number below `bound`; 0 if `bound` is 0. By remainder: the bias is below
    /// `bound / 2⁶⁴`.
    pub fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.next_u64() % bound.max(1) as u64).unwrap_or(0)
    }

    /// A random order of `0..len` (Fisher–Yates).
    pub fn order(&mut self, len: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..len).collect();
        for i in (1..len).rev() {
            order.swap(i, self.below(i + 1));
        }
        order
    }
}

/// Standard normal value of two independent uniform values in `[0, 1)` (Box–Muller, one of the
/// pair).
pub fn standard_normal<F: Real>(u: F, v: F) -> F {
    let tau = F::from_double(std::f64::consts::TAU);
    (F::of(-2.0) * (F::one() - u).ln()).sqrt() * (tau * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the reference implementation (<https://prng.di.unimi.it/splitmix64.c>).
    #[test]
    fn the_sequence_equals_the_reference() {
        let mut random = SplitMix64::new(1_234_567);
        let first = [0; 3].map(|_| random.next_u64());
        let reference =
            [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423];
        assert_eq!(first, reference);
    }

    #[test]
    fn orders_are_permutations() {
        let mut order = SplitMix64::new(5).order(100);
        assert_ne!(order, (0..100).collect::<Vec<_>>(), "random");
        order.sort_unstable();
        assert_eq!(order, (0..100).collect::<Vec<_>>(), "each once");
        assert_eq!(SplitMix64::new(5).below(0), 0, "no panic");
    }

    #[test]
    fn normals_have_unit_variance() {
        let mut random = SplitMix64::new(1);
        let mut uniform = || (random.next_u64() >> 11) as f64 * (0.5 * f64::EPSILON);
        let draws: Vec<f64> = (0..20_000).map(|_| standard_normal(uniform(), uniform())).collect();
        let mean = draws.iter().sum::<f64>() / 20_000.0;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }
}
