//! Least-squares rotation between two weighted point sets.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use crate::eigenvector::{self, Matrices};
use crate::simd::Lanes;
use gs_core::rotation_matrix;
pub(crate) use gs_core::symmetric_eigen as eigen;

/// Running sums of weighted rigid fits `y ≈ R (x − x̄) + ȳ`, one per lane.
///
/// Solved as the largest eigenvectors of Davenport's 4×4 matrices: no special cases for signs,
/// defined for any input, and prior rotations are further terms of the same matrices.
#[derive(Debug, Clone)]
pub(crate) struct RigidFits<const L: usize> {
    from: [Lanes<L>; 3],
    to: [Lanes<L>; 3],
    cross: [[Lanes<L>; 3]; 3],
    spread: Lanes<L>,
    /// Upper triangle.
    prior: Matrices<L>,
    prior_weight: Lanes<L>,
}

impl<const L: usize> RigidFits<L> {
    /// Fits about the given centroids.
    #[inline(always)]
    pub(crate) fn about(from: [Lanes<L>; 3], to: [Lanes<L>; 3]) -> Self {
        Self {
            from,
            to,
            cross: [[Lanes::ZERO; 3]; 3],
            spread: Lanes::ZERO,
            prior: [[Lanes::ZERO; 4]; 4],
            prior_weight: Lanes::ZERO,
        }
    }

    /// Adds pairs of points.
    #[inline(always)]
    pub(crate) fn add(&mut self, weight: Lanes<L>, x: [Lanes<L>; 3], y: [Lanes<L>; 3]) {
        for i in 0..3 {
            let dx = x[i] - self.from[i];
            let weighted = weight * dx;
            for j in 0..3 {
                self.cross[i][j] += weighted * (y[j] - self.to[j]);
            }
            self.spread += weighted * dx;
        }
    }

    /// Adds prior rotations.
    #[inline(always)]
    pub(crate) fn add_rotation(&mut self, weight: Lanes<L>, r: [Lanes<L>; 4]) {
        for i in 0..4 {
            let weighted = weight * r[i];
            for j in i..4 {
                self.prior[i][j] += weighted * r[j];
            }
        }
        self.prior_weight += weight;
    }

    /// See [`RigidFit::rotation`].
    #[inline(always)]
    pub(crate) fn rotation(&self, prior: f64) -> [Lanes<L>; 4] {
        let s = &self.cross;
        let spread = self.spread.map(|spread| if spread > 0.0 { spread } else { 1.0 });
        let mut n = [[Lanes::ZERO; 4]; 4];
        n[0][0] = s[0][0] + s[1][1] + s[2][2] + Lanes::all(1e-9) * spread;
        n[1][1] = s[0][0] - s[1][1] - s[2][2];
        n[2][2] = s[1][1] - s[0][0] - s[2][2];
        n[3][3] = s[2][2] - s[0][0] - s[1][1];
        n[0][1] = s[1][2] - s[2][1];
        n[0][2] = s[2][0] - s[0][2];
        n[0][3] = s[0][1] - s[1][0];
        n[1][2] = s[0][1] + s[1][0];
        n[1][3] = s[2][0] + s[0][2];
        n[2][3] = s[1][2] + s[2][1];
        let mut scale = spread;
        for lane in 0..L {
            let weight = self.prior_weight.0[lane];
            scale.0[lane] = if weight > 0.0 { 4.0 * prior * spread.0[lane] / weight } else { 0.0 };
        }
        for i in 0..4 {
            for j in i..4 {
                n[i][j] += scale * self.prior[i][j];
                n[j][i] = n[i][j];
            }
        }
        let q = eigenvector::largest(&n);
        let mut flip = [false; L];
        for lane in 0..L {
            flip[lane] = q[0].0[lane] < 0.0;
        }
        q.map(|c| c.select(flip, -c))
    }

    /// Images of `x` under the motions with rotations `r`.
    #[inline(always)]
    pub(crate) fn apply(&self, r: [Lanes<L>; 4], x: [Lanes<L>; 3]) -> [Lanes<L>; 3] {
        let d = [x[0] - self.from[0], x[1] - self.from[1], x[2] - self.from[2]];
        let [w, axis @ ..] = r;
        let cross = |a: [Lanes<L>; 3], b: [Lanes<L>; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let twice = cross(axis, d).map(|c| c + c);
        let again = cross(axis, twice);
        [0, 1, 2].map(|i| self.to[i] + d[i] + w * twice[i] + again[i])
    }
}

/// One fit of [`RigidFits`].
#[derive(Debug, Clone)]
pub(crate) struct RigidFit(RigidFits<1>);

fn lane<const N: usize>(values: [f64; N]) -> [Lanes<1>; N] {
    values.map(|value| Lanes([value]))
}

impl RigidFit {
    /// A fit about the given centroids.
    pub(crate) fn about(from: [f64; 3], to: [f64; 3]) -> Self {
        Self(RigidFits::about(lane(from), lane(to)))
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
    #[inline]
    pub(crate) fn add(&mut self, weight: f64, x: [f64; 3], y: [f64; 3]) {
        self.0.add(Lanes([weight]), lane(x), lane(y));
    }

    /// Adds a prior rotation.
    #[inline]
    pub(crate) fn add_rotation(&mut self, weight: f64, r: [f64; 4]) {
        self.0.add_rotation(Lanes([weight]), lane(r));
    }

    /// Unit quaternion `wxyz` of the best rotation; `prior` is the weight of the prior rotations
    /// relative to the points. Where the points do not determine the rotation (coincident or
    /// collinear points), the prior rotations do, and without these the smallest angle is chosen.
    pub(crate) fn rotation(&self, prior: f64) -> [f64; 4] {
        self.0.rotation(prior).map(|value| value.0[0])
    }

    /// Scale that best fits together with rotation `r` (Umeyama): 0 if all points coincide.
    pub(crate) fn scale(&self, r: [f64; 4]) -> f64 {
        let matrix = rotation_matrix(r);
        let mut agreement = 0.0;
        for (i, row) in self.cross().iter().enumerate() {
            for (j, sum) in row.iter().enumerate() {
                agreement += matrix[j][i] * sum;
            }
        }
        let spread = self.0.spread.0[0];
        if spread > 0.0 { agreement / spread } else { 0.0 }
    }

    /// Whether the points do not determine the rotation: both sets extend in at most one common
    /// direction.
    pub(crate) fn is_linear(&self) -> bool {
        let s = self.cross();
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

    /// Image of `x` under the motion with rotation `r`.
    pub(crate) fn apply(&self, r: [f64; 4], x: [f64; 3]) -> [f64; 3] {
        self.0.apply(lane(r), lane(x)).map(|value| value.0[0])
    }

    fn cross(&self) -> [[f64; 3]; 3] {
        self.0.cross.map(|row| row.map(|value| value.0[0]))
    }
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
    use gs_core::quat;

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
    fn any_rotation_is_recovered_including_180_degrees() {
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

    #[test]
    fn undetermined_rotations_are_as_small_as_possible() {
        let still = fit_of(&[[1.0, 2.0, 3.0]], [1.0, 0.0, 0.0, 0.0]).rotation(0.0);
        assert!((still[0] - 1.0).abs() < 1e-12, "one point: {still:?}");
        let rotation = quat::normalize([1.0, 0.0, 0.0, 0.5]);
        let line = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let found = fit_of(&line, rotation).rotation(0.0);
        assert!(1.0 - quat::dot(found, rotation).abs() < 1e-6, "a line: {found:?}");
        let mut prior = fit_of(&[[1.0, 2.0, 3.0]], rotation);
        prior.add_rotation(1.0, rotation);
        let found = prior.rotation(0.3);
        assert!(
            1.0 - quat::dot(found, rotation).abs() < 1e-9,
            "the prior determines it: {found:?}"
        );
    }
}
