//! Eigenvectors of symmetric 4×4 matrices for their largest eigenvalues, several matrices at once.
//!
//! The eigenvalue is the largest root of the characteristic polynomial, found by Newton's method
//! from above, where the polynomial is convex; the eigenvector is a column of the adjugate. Where
//! other eigenvalues are close, both lose precision, and Jacobi rotations are used instead. Lanes
//! are independent.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use crate::simd::Lanes;
use gs_core::{quat, symmetric_eigen};

/// Maximum number of Newton steps; in practice nearly all matrices need at most six.
const STEPS: usize = 16;

/// Minimum product of the gaps to the other eigenvalues, in units of the matrix's size. About ten
/// digits remain at this limit; below it, Jacobi rotations are used.
const GAPS: f64 = 1e-6;

/// Matrices `[4][4]`, lane by lane.
pub(crate) type Matrices<const L: usize> = [[Lanes<L>; 4]; 4];

/// Unit eigenvectors `[4]` of the largest eigenvalues.
#[inline(always)]
pub(crate) fn largest<const L: usize>(a: &Matrices<L>) -> [Lanes<L>; 4] {
    let (mut found, answered) = simple(a);
    for lane in (0..L).filter(|&lane| !answered[lane]) {
        let vector = by_rotations(a.map(|row| row.map(|value| value.0[lane])));
        for (found, value) in found.iter_mut().zip(vector) {
            found.0[lane] = value;
        }
    }
    found
}

#[cold]
fn by_rotations(a: [[f64; 4]; 4]) -> [f64; 4] {
    let (values, v) = symmetric_eigen(a);
    let best = (1..4).fold(0, |best, i| if values[i] > values[best] { i } else { best });
    quat::normalize([v[0][best], v[1][best], v[2][best], v[3][best]])
}

/// Eigenvectors of simple eigenvalues, and for which lanes they were found.
#[inline(always)]
fn simple<const L: usize>(a: &Matrices<L>) -> ([Lanes<L>; 4], [bool; L]) {
    // Without its mean the matrix has no cubic term, and its size is that of the gaps.
    let mean = (a[0][0] + a[1][1] + a[2][2] + a[3][3]) * Lanes::all(0.25);
    let mut m = *a;
    for i in 0..4 {
        m[i][i] = m[i][i] - mean;
    }
    let mut squares = Lanes::ZERO;
    for row in &m {
        for &value in row {
            squares += value * value;
        }
    }
    let mut good = [true; L];
    for lane in 0..L {
        good[lane] = squares.0[lane] > 0.0 && squares.0[lane].is_finite();
    }
    let inverse = squares.map(|square| if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 });
    for row in &mut m {
        for value in row {
            *value = *value * inverse;
        }
    }
    // λ⁴ + c₂ λ² + c₁ λ + c₀, with the squares of the eigenvalues summing to 1.
    let adjugate = Adjugate::of(&m);
    let (c1, c0) = (-adjugate.trace(), adjugate.determinant);
    let slope_at = |root: Lanes<L>| (Lanes::all(4.0) * root * root - Lanes::all(1.0)) * root + c1;
    // No eigenvalue of a trace-free matrix of unit size is larger than this.
    let mut root = Lanes::all(0.75_f64.sqrt());
    let mut settled = [false; L];
    for _ in 0..STEPS {
        let value = ((root * root - Lanes::all(0.5)) * root + c1) * root + c0;
        let slope = slope_at(root);
        let mut under_way = false;
        for lane in 0..L {
            let active = good[lane] && !settled[lane];
            good[lane] &= settled[lane] || slope.0[lane] > GAPS;
            let step = value.0[lane] / slope.0[lane];
            let active = active && good[lane];
            root.0[lane] = if active { root.0[lane] - step } else { root.0[lane] };
            // The convergence is quadratic towards a simple root and linear towards a double one.
            settled[lane] |= active && step <= 1e-12;
            under_way |= active && !settled[lane];
        }
        if !under_way {
            break;
        }
    }
    let slope = slope_at(root);
    for i in 0..4 {
        m[i][i] = m[i][i] - root;
    }
    let mut vector = longest_column(&Adjugate::of(&m).columns);
    let mut square = Lanes::ZERO;
    for value in vector {
        square += value * value;
    }
    let inverse = square.map(|square| if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 });
    for lane in 0..L {
        good[lane] &= settled[lane] && slope.0[lane] > GAPS && inverse.0[lane] > 0.0;
    }
    for value in &mut vector {
        *value = *value * inverse;
    }
    (vector, good)
}

/// The longest column of an adjugate, by its diagonal entry. Every column is a multiple of the
/// eigenvector; the longest one is the most accurate.
#[inline(always)]
fn longest_column<const L: usize>(columns: &Matrices<L>) -> [Lanes<L>; 4] {
    let mut vector = columns[0];
    let mut longest = columns[0][0].map(f64::abs);
    for (i, column) in columns.iter().enumerate().skip(1) {
        let length = column[i].map(f64::abs);
        let mut better = [false; L];
        for lane in 0..L {
            better[lane] = length.0[lane] > longest.0[lane];
        }
        longest = longest.select(better, length);
        for (kept, value) in vector.iter_mut().zip(column) {
            *kept = kept.select(better, *value);
        }
    }
    vector
}

/// Adjugates of symmetric matrices, by columns, and determinants.
struct Adjugate<const L: usize> {
    columns: Matrices<L>,
    determinant: Lanes<L>,
}

impl<const L: usize> Adjugate<L> {
    #[inline(always)]
    fn of(m: &Matrices<L>) -> Self {
        let minor = |a: Lanes<L>, b: Lanes<L>, c: Lanes<L>, d: Lanes<L>| a * d - b * c;
        // Minors of the upper two rows and of the lower two, by their columns.
        let upper = |i: usize, j: usize| minor(m[0][i], m[0][j], m[1][i], m[1][j]);
        let lower = |i: usize, j: usize| minor(m[2][i], m[2][j], m[3][i], m[3][j]);
        let (s01, s02, s03) = (upper(0, 1), upper(0, 2), upper(0, 3));
        let (s12, s13, s23) = (upper(1, 2), upper(1, 3), upper(2, 3));
        let (c01, c02, c03) = (lower(0, 1), lower(0, 2), lower(0, 3));
        let (c12, c13, c23) = (lower(1, 2), lower(1, 3), lower(2, 3));
        let a00 = m[1][1] * c23 - m[1][2] * c13 + m[1][3] * c12;
        let a01 = m[0][2] * c13 - m[0][1] * c23 - m[0][3] * c12;
        let a02 = m[3][1] * s23 - m[3][2] * s13 + m[3][3] * s12;
        let a03 = m[2][2] * s13 - m[2][1] * s23 - m[2][3] * s12;
        let a11 = m[0][0] * c23 - m[0][2] * c03 + m[0][3] * c02;
        let a12 = m[3][2] * s03 - m[3][0] * s23 - m[3][3] * s02;
        let a13 = m[2][0] * s23 - m[2][2] * s03 + m[2][3] * s02;
        let a22 = m[3][0] * s13 - m[3][1] * s03 + m[3][3] * s01;
        let a23 = m[2][1] * s03 - m[2][0] * s13 - m[2][3] * s01;
        let a33 = m[2][0] * s12 - m[2][1] * s02 + m[2][2] * s01;
        let determinant = s01 * c23 - s02 * c13 + s03 * c12 + s12 * c03 - s13 * c02 + s23 * c01;
        Self {
            columns: [
                [a00, a01, a02, a03],
                [a01, a11, a12, a13],
                [a02, a12, a22, a23],
                [a03, a13, a23, a33],
            ],
            determinant,
        }
    }

    #[inline(always)]
    fn trace(&self) -> Lanes<L> {
        let c = &self.columns;
        c[0][0] + c[1][1] + c[2][2] + c[3][3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both methods agree wherever Newton's method finds an eigenvector, in every lane, and it does
    /// for typical fits.
    #[test]
    fn newton_eigenvectors_equal_those_of_jacobi_rotations() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut answered = 0;
        for round in 0..500 {
            let scale = 10.0_f64.powi(round % 13 - 6);
            let mut lanes = [[Lanes::<4>::ZERO; 4]; 4];
            for i in 0..4 {
                for j in i..4 {
                    lanes[i][j] = Lanes([next(), next(), next(), next()]) * Lanes::all(scale);
                    lanes[j][i] = lanes[i][j];
                }
            }
            let (found, good) = simple(&lanes);
            for lane in 0..4 {
                let a = lanes.map(|row| row.map(|value| value.0[lane]));
                let (values, v) = symmetric_eigen(a);
                let best = (1..4).fold(0, |b, i| if values[i] > values[b] { i } else { b });
                let expected = [0, 1, 2, 3].map(|i| v[i][best]);
                let alone = simple(&a.map(|row| row.map(|value| Lanes([value]))));
                assert_eq!(alone.1[0], good[lane], "one lane and several");
                if good[lane] {
                    answered += 1;
                    let vector = found.map(|value| value.0[lane]);
                    let off = 1.0 - quat::dot(vector, expected).abs();
                    assert!(off < 1e-12, "{a:?}: {off}");
                    assert_eq!(alone.0.map(|value| value.0[0]), vector, "bits of {a:?}");
                }
            }
        }
        assert!(answered > 1950, "{answered}");
        let nothing = simple(&[[Lanes::<1>::ZERO; 4]; 4]);
        assert_eq!(nothing.1, [false], "zero matrix");
        let mut twins = [[Lanes::<1>::ZERO; 4]; 4];
        (twins[0][0], twins[1][1]) = (Lanes([1.0]), Lanes([1.0]));
        assert_eq!(simple(&twins).1, [false], "double eigenvalue");
        assert_eq!(simple(&[[Lanes([f64::NAN]); 4]; 4]).1, [false], "NaN");
    }
}
