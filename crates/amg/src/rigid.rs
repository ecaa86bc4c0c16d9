//! The rotation that best turns one weighted point set into another.

pub(crate) use gs_core::symmetric_eigen as eigen;
use gs_core::{quat, rotation_matrix};

/// Running sums of a weighted rigid fit `y ≈ R (x − x̄) + ȳ`.
///
/// Solved as the largest eigenvector of Davenport's 4×4 matrix: no sign cases, defined for any input, and rotations
/// known beforehand enter as further terms of the same matrix.
#[derive(Debug, Clone)]
pub(crate) struct RigidFit {
    from: [f64; 3],
    to: [f64; 3],
    cross: [[f64; 3]; 3],
    spread: f64,
    prior: [[f64; 4]; 4],
    prior_weight: f64,
}

impl RigidFit {
    /// A fit about the given centroids.
    pub(crate) fn about(from: [f64; 3], to: [f64; 3]) -> Self {
        Self {
            from,
            to,
            cross: [[0.0; 3]; 3],
            spread: 0.0,
            prior: [[0.0; 4]; 4],
            prior_weight: 0.0,
        }
    }

    /// A fit of weighted pairs of points about their centroids.
    pub(crate) fn of(pairs: impl Iterator<Item = (f64, [f64; 3], [f64; 3])> + Clone) -> Self {
        let (mut from, mut to, mut total) = ([0.0; 3], [0.0; 3], 0.0);
        for (weight, x, y) in pairs.clone() {
            total += weight;
            for k in 0..3 {
                from[k] += weight * x[k];
                to[k] += weight * y[k];
            }
        }
        let mut fit = Self::about(from.map(|v| v / total), to.map(|v| v / total));
        pairs.for_each(|(weight, x, y)| fit.add(weight, x, y));
        fit
    }

    /// Adds a pair of points.
    pub(crate) fn add(&mut self, weight: f64, x: [f64; 3], y: [f64; 3]) {
        let (dx, dy) = (sub(x, self.from), sub(y, self.to));
        for i in 0..3 {
            for j in 0..3 {
                self.cross[i][j] += weight * dx[i] * dy[j];
            }
        }
        self.spread += weight * dot(dx, dx);
    }

    /// Adds a rotation the fit should resemble.
    pub(crate) fn add_rotation(&mut self, weight: f64, r: [f64; 4]) {
        for i in 0..4 {
            for j in 0..4 {
                self.prior[i][j] += weight * r[i] * r[j];
            }
        }
        self.prior_weight += weight;
    }

    /// Unit quaternion `wxyz` of the best rotation; `prior` is the weight of the added rotations relative to the points.
    /// Whatever the points leave open (coincident or collinear ones) is decided by the added rotations, then by turning
    /// as little as possible.
    pub(crate) fn rotation(&self, prior: f64) -> [f64; 4] {
        let s = &self.cross;
        let spread = if self.spread > 0.0 { self.spread } else { 1.0 };
        let mut n = [[0.0; 4]; 4];
        n[0][0] = s[0][0] + s[1][1] + s[2][2];
        n[1][1] = s[0][0] - s[1][1] - s[2][2];
        n[2][2] = s[1][1] - s[0][0] - s[2][2];
        n[3][3] = s[2][2] - s[0][0] - s[1][1];
        n[0][1] = s[1][2] - s[2][1];
        n[0][2] = s[2][0] - s[0][2];
        n[0][3] = s[0][1] - s[1][0];
        n[1][2] = s[0][1] + s[1][0];
        n[1][3] = s[2][0] + s[0][2];
        n[2][3] = s[1][2] + s[2][1];
        if self.prior_weight > 0.0 {
            let scale = 4.0 * prior * spread / self.prior_weight;
            for i in 0..4 {
                for j in i..4 {
                    n[i][j] += scale * self.prior[i][j];
                }
            }
        }
        n[0][0] += 1e-9 * spread;
        for i in 0..4 {
            for j in 0..i {
                n[i][j] = n[j][i];
            }
        }
        let q = largest_eigenvector(n);
        if q[0] < 0.0 { q.map(|c| -c) } else { q }
    }

    /// Scale that best fits together with rotation `r` (Umeyama): 0 if all points coincide.
    pub(crate) fn scale(&self, r: [f64; 4]) -> f64 {
        let turn = rotation_matrix(r);
        let mut agreement = 0.0;
        for (i, row) in self.cross.iter().enumerate() {
            for (j, sum) in row.iter().enumerate() {
                agreement += turn[j][i] * sum;
            }
        }
        if self.spread > 0.0 { agreement / self.spread } else { 0.0 }
    }

    /// Whether the points do not determine the rotation: at most one direction in which both sets spread.
    pub(crate) fn is_linear(&self) -> bool {
        let s = &self.cross;
        let mut squares = [[0.0; 3]; 3];
        for (i, row) in squares.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = dot(s[i], s[j]);
            }
        }
        let (mut values, _) = eigen(squares);
        values.sort_by(f64::total_cmp);
        // Squares of singular values: the second is below a thousandth of the first.
        values[1].is_nan() || values[1] <= 1e-6 * values[2]
    }

    /// Where the motion with rotation `r` takes `x`.
    pub(crate) fn apply(&self, r: [f64; 4], x: [f64; 3]) -> [f64; 3] {
        let turned = quat::rotate(r, sub(x, self.from));
        [self.to[0] + turned[0], self.to[1] + turned[1], self.to[2] + turned[2]]
    }
}

/// Unit eigenvector of the largest eigenvalue of a symmetric matrix.
///
/// The eigenvalue is the largest root of the characteristic polynomial, by Newton's method from above, where it is convex;
/// the eigenvector a column of the adjugate. Where other eigenvalues are near, both lose digits, and Jacobi rotations are
/// taken instead.
fn largest_eigenvector(a: [[f64; 4]; 4]) -> [f64; 4] {
    if let Some(vector) = simple_eigenvector(&a) {
        return vector;
    }
    let (values, v) = eigen(a);
    let best = (1..4).fold(0, |best, i| if values[i] > values[best] { i } else { best });
    quat::normalize([v[0][best], v[1][best], v[2][best], v[3][best]])
}

/// Newton steps; of the matrices met, nearly all need six or fewer.
const STEPS: usize = 16;

/// Product of the gaps to the other eigenvalues, in units of the matrix's size, below which too many digits are lost: about ten
/// are left there.
const GAPS: f64 = 1e-6;

fn simple_eigenvector(a: &[[f64; 4]; 4]) -> Option<[f64; 4]> {
    let trace = a[0][0] + a[1][1] + a[2][2] + a[3][3];
    let mean = 0.25 * trace;
    // Without its mean the matrix has no cubic term, and its size is that of the gaps.
    let mut m = *a;
    for (i, row) in m.iter_mut().enumerate() {
        row[i] -= mean;
    }
    let squares: f64 = m.iter().flatten().map(|x| x * x).sum();
    let size = squares.sqrt();
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    let inverse = 1.0 / size;
    for row in &mut m {
        *row = row.map(|x| x * inverse);
    }
    // λ⁴ + c₂ λ² + c₁ λ + c₀, with the squares of the eigenvalues summing to 1.
    let c2 = -0.5;
    let minor = |i: usize, j: usize| cofactor(&m, i, j);
    let c1 = -(minor(0, 0) + minor(1, 1) + minor(2, 2) + minor(3, 3));
    let c0 = m[0][0] * minor(0, 0)
        + m[0][1] * minor(0, 1)
        + m[0][2] * minor(0, 2)
        + m[0][3] * minor(0, 3);
    // No eigenvalue of a trace-free matrix of unit size is larger than this.
    let mut root = 0.75_f64.sqrt();
    let mut settled = false;
    for _ in 0..STEPS {
        let value = ((root * root + c2) * root + c1) * root + c0;
        let slope = (4.0 * root * root + 2.0 * c2) * root + c1;
        if slope <= GAPS {
            return None;
        }
        let step = value / slope;
        root -= step;
        // Towards a simple root, the next step is the square of this one; towards a double one, half of it.
        settled = step <= 1e-12;
        if settled {
            break;
        }
    }
    if !settled || (4.0 * root * root + 2.0 * c2) * root + c1 <= GAPS {
        return None;
    }
    for (i, row) in m.iter_mut().enumerate() {
        row[i] -= root;
    }
    // Every column of the adjugate is a multiple of the eigenvector; the longest one has the most digits.
    let diagonal = [0, 1, 2, 3].map(|i| cofactor(&m, i, i).abs());
    let best = (1..4).fold(0, |best, i| if diagonal[i] > diagonal[best] { i } else { best });
    let column = [0, 1, 2, 3].map(|i| cofactor(&m, i, best));
    Some(quat::normalize(column))
}

/// Signed minor of row `i` and column `j`.
fn cofactor(m: &[[f64; 4]; 4], i: usize, j: usize) -> f64 {
    let others = |k: usize| match k {
        0 => [1, 2, 3],
        1 => [0, 2, 3],
        2 => [0, 1, 3],
        _ => [0, 1, 2],
    };
    let ([a, b, c], [p, q, r]) = (others(i), others(j));
    let minor = m[a][p] * (m[b][q] * m[c][r] - m[b][r] * m[c][q])
        - m[a][q] * (m[b][p] * m[c][r] - m[b][r] * m[c][p])
        + m[a][r] * (m[b][p] * m[c][q] - m[b][q] * m[c][p]);
    if (i + j).is_multiple_of(2) { minor } else { -minor }
}

pub(crate) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit_of(points: &[[f64; 3]], r: [f64; 4]) -> RigidFit {
        let n = points.len() as f64;
        let mean = |of: &dyn Fn([f64; 3]) -> [f64; 3]| {
            points.iter().fold([0.0; 3], |m, &p| {
                let p = of(p);
                [m[0] + p[0] / n, m[1] + p[1] / n, m[2] + p[2] / n]
            })
        };
        let mut fit = RigidFit::about(mean(&|p| p), mean(&|p| quat::rotate(r, p)));
        for &p in points {
            fit.add(1.0, p, quat::rotate(r, p));
        }
        fit
    }

    #[test]
    fn recovers_any_rotation_half_turns_included() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 2.0, 0.3], [0.1, -0.4, 1.0]];
        for r in [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.6, 0.8, 0.0],
            quat::normalize([0.3, -0.5, 0.2, 0.9]),
            quat::normalize([1e-9, 0.0, 1.0, 0.0]),
        ] {
            let found = fit_of(&points, r).rotation(0.0);
            let agreement = quat::dot(found, r).abs();
            assert!(1.0 - agreement < 1e-12, "{r:?} became {found:?}");
        }
    }

    /// Both ways to the eigenvector agree wherever the quick one answers, and it answers for what is met in practice.
    #[test]
    fn quick_eigenvectors_are_those_of_jacobi_rotations() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut answered = 0;
        for round in 0..2000 {
            let scale = 10.0_f64.powi(round % 13 - 6);
            let mut a = [[0.0; 4]; 4];
            for i in 0..4 {
                for j in i..4 {
                    a[i][j] = scale * next();
                    a[j][i] = a[i][j];
                }
            }
            let (values, v) = eigen(a);
            let best = (1..4).fold(0, |best, i| if values[i] > values[best] { i } else { best });
            let expected = [0, 1, 2, 3].map(|i| v[i][best]);
            if let Some(found) = simple_eigenvector(&a) {
                answered += 1;
                let off = 1.0 - quat::dot(found, expected).abs();
                assert!(off < 1e-12, "{a:?}: {off}");
            }
        }
        assert!(answered > 1950, "{answered}");
        assert_eq!(simple_eigenvector(&[[0.0; 4]; 4]), None, "no direction");
        let mut twins = [[0.0; 4]; 4];
        (twins[0][0], twins[1][1]) = (1.0, 1.0);
        assert_eq!(simple_eigenvector(&twins), None, "two directions");
    }

    #[test]
    fn open_cases_turn_as_little_as_possible() {
        let still = fit_of(&[[1.0, 2.0, 3.0]], [1.0, 0.0, 0.0, 0.0]).rotation(0.0);
        assert!((still[0] - 1.0).abs() < 1e-12, "one point: {still:?}");
        let turn = quat::normalize([1.0, 0.0, 0.0, 0.5]);
        let line = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let found = fit_of(&line, turn).rotation(0.0);
        assert!(1.0 - quat::dot(found, turn).abs() < 1e-6, "a line: {found:?}");
        let mut prior = fit_of(&[[1.0, 2.0, 3.0]], turn);
        prior.add_rotation(1.0, turn);
        let found = prior.rotation(0.3);
        assert!(1.0 - quat::dot(found, turn).abs() < 1e-9, "the prior decides: {found:?}");
    }
}
