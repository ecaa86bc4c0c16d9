//! [`AxisPermutation`]: the 24 rotations of the cube, which permute a Gaussian's axes.
//!
//! Of the quaternions that describe the same ellipsoid, the one closest to the identity is stored.
//! Its real part is at least 0.85 and can be computed from the other three components.

use gs_core::quat;

/// Half the square root of two.
const HALF_SQRT_2: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A rotation of the cube, and the order of the local axes after it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AxisPermutation {
    rotation: [f64; 4],
    axes: [usize; 3],
}

impl AxisPermutation {
    /// All 24.
    pub(crate) fn all() -> Vec<Self> {
        let mut found = Vec::with_capacity(24);
        let digits = [-1.0, 0.0, 1.0];
        for code in 0..81_usize {
            let raw = [1, 3, 9, 27].map(|place| digits[code / place % 3]);
            let used = raw.iter().filter(|value| **value != 0.0).count();
            let size = match used {
                1 => 1.0,
                2 => HALF_SQRT_2,
                4 => 0.5,
                _ => continue,
            };
            // A quaternion and its negative are the same rotation.
            if raw.iter().find(|value| **value != 0.0) == Some(&1.0) {
                found.push(Self::of(raw.map(|value| value * size)));
            }
        }
        found
    }

    fn of(rotation: [f64; 4]) -> Self {
        let rows = gs_core::rotation_matrix(rotation);
        let axes = [0, 1, 2].map(|column| {
            (0..3).find(|&row: &usize| rows[row][column].abs() > 0.5).unwrap_or(column)
        });
        Self { rotation, axes }
    }

    /// Index in `permutations` of the one that brings `q` closest to the identity; ties go to the
    /// first.
    pub(crate) fn best(permutations: &[Self], q: [f64; 4]) -> u8 {
        let mut best = (0, -1.0);
        for (index, axis_permutation) in (0_u8..).zip(permutations) {
            let real = axis_permutation.rotate(q)[0].abs();
            if real > best.1 + 1e-9 {
                best = (index, real);
            }
        }
        best.0
    }

    /// The quaternion `wxyz` after this permutation of the axes.
    pub(crate) fn rotate(&self, q: [f64; 4]) -> [f64; 4] {
        quat::mul(q, self.rotation)
    }

    /// Scales after this permutation of the axes.
    pub(crate) fn permute<T: Copy>(&self, scales: [T; 3]) -> [T; 3] {
        self.axes.map(|axis| scales[axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_core::covariance;

    #[test]
    fn every_permutation_describes_the_same_ellipsoid_and_the_best_is_near_the_identity() {
        let permutations = AxisPermutation::all();
        assert_eq!(permutations.len(), 24, "rotations of a cube");
        let scale = [1.0, 2.0, 5.0];
        for seed in 0..200_u32 {
            let part = |k: u32| f64::from((seed * 7919 + k * 104_729) % 1000) / 500.0 - 0.999;
            let q = quat::normalize([part(1), part(2), part(3), part(4)]);
            let expected = covariance(q, scale);
            for axis_permutation in &permutations {
                let found = covariance(axis_permutation.rotate(q), axis_permutation.permute(scale));
                for (a, b) in found.iter().zip(expected) {
                    assert!(
                        (a - b).abs() < 1e-9,
                        "{axis_permutation:?}: {found:?}, expected {expected:?}"
                    );
                }
            }
            let best = &permutations[usize::from(AxisPermutation::best(&permutations, q))];
            assert!(best.rotate(q)[0].abs() > 0.85, "{:?}", best.rotate(q));
        }
    }
}
