//! Rigid motion of each cell's surroundings, at each key time.

use super::cloud::{Cloud, Companions, median};
use crate::keyframes::FADED;
use crate::rigid::{RigidFit, dot, sub};
use gs_core::{Real, quat};
use rayon::prelude::*;

/// Weight of the splats' own rotations, if they are as good as any.
pub(super) const ROTATION_PRIOR: f64 = 3.0;

/// Rigid motions of the cells. Cells that are floaters themselves are marked and not followed.
#[derive(Debug)]
pub(super) struct CellMotion {
    pub(super) floater: Vec<bool>,
    /// Cells that stay where they are, as do all around them.
    pub(super) still: Vec<bool>,
    /// Factor on the weight of own rotations, 0 to 1: 0 where the scene does not model rotation.
    pub(super) rotation_trust: f64,
    /// `[N][T]`.
    motions: Vec<Motion>,
    /// How far the cell is still there, `[N][T]`.
    seen: Vec<f32>,
    num_times: usize,
}

/// `x ↦ R (x − from) + to`.
#[derive(Debug, Clone, Copy, Default)]
struct Motion {
    turn: [f32; 4],
    from: [f32; 3],
    to: [f32; 3],
}

impl CellMotion {
    pub(super) fn of(cloud: &Cloud, companions: &Companions) -> Self {
        let floater = companions.floaters(cloud);
        let num_times = cloud.num_times();
        let stencil = |i: usize| -> Vec<(f64, usize)> {
            (0..companions.near[i].len())
                .map(|slot| {
                    let j = companions.near[i][slot].id as usize;
                    let weight = companions.spatial(cloud, i, slot) * companions.agree[i][slot];
                    (if floater[j] && slot > 0 { 0.0 } else { weight }, j)
                })
                .filter(|(weight, _)| *weight > 1e-9)
                .collect()
        };
        let trust = rotation_trust(cloud, &floater, &stencil);
        let still: Vec<bool> = (0..cloud.len())
            .map(|i| companions.near[i].iter().all(|n| !cloud.moving[n.id as usize]))
            .collect();
        let motions = (0..cloud.len())
            .into_par_iter()
            .with_min_len(64)
            .flat_map_iter(|i| {
                let stencil = if still[i] { Vec::new() } else { stencil(i) };
                (0..num_times).map(move |k| {
                    if stencil.is_empty() {
                        return Motion::STILL;
                    }
                    let fit = fit(cloud, k, &stencil);
                    fit.into_motion(ROTATION_PRIOR * trust)
                })
            })
            .collect();
        let seen = (0..cloud.len())
            .flat_map(|i| (0..num_times).map(move |k| f32::from_double(cloud.seen(k, i))))
            .collect();
        Self { floater, still, rotation_trust: trust, motions, seen, num_times }
    }

    /// Where point `x` goes at key time `k` if it moves with cell `i`.
    fn carry(&self, i: usize, k: usize, x: [f32; 3]) -> [f32; 3] {
        let motion = &self.motions[i * self.num_times + k];
        let arm = [x[0] - motion.from[0], x[1] - motion.from[1], x[2] - motion.from[2]];
        let turned = quat::rotate(motion.turn, arm);
        [turned[0] + motion.to[0], turned[1] + motion.to[1], turned[2] + motion.to[2]]
    }

    /// Where point `x` goes if it moves with cell `i`.
    pub(super) fn path(&self, i: usize, x: [f32; 3]) -> Path {
        let places = (0..self.num_times).map(|k| self.carry(i, k, x)).collect();
        Path { cell: i, from: x, places }
    }

    /// Whether cell `i` never takes the point farther from its path than `tolerance`.
    pub(super) fn agrees(&self, i: usize, path: &Path, tolerance: f32) -> bool {
        let near = |(k, place): (usize, &[f32; 3])| {
            let other = self.carry(i, k, path.from);
            self.apart(path.cell, i, k, *place, other) <= tolerance * tolerance
        };
        self.alike(i, path.cell) || path.places.iter().enumerate().all(near)
    }

    /// Largest distance over time between where cells `a` and `b` take point `x`, as far as both are seen.
    pub(super) fn disagreement(&self, a: usize, b: usize, x: [f32; 3]) -> f32 {
        if self.alike(a, b) {
            return 0.0;
        }
        let apart = |k: usize| self.apart(a, b, k, self.carry(a, k, x), self.carry(b, k, x));
        (0..self.num_times).fold(0.0_f32, |worst, k| worst.max(apart(k))).sqrt()
    }

    /// Whether two cells have one motion by what they are.
    fn alike(&self, a: usize, b: usize) -> bool {
        a == b || (self.still[a] && self.still[b])
    }

    /// Squared distance between where cells `a` and `b` take a point at key time `k`, `p` and `q`, as far as both are seen.
    fn apart(&self, a: usize, b: usize, k: usize, p: [f32; 3], q: [f32; 3]) -> f32 {
        let d = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let seen = |i: usize| self.seen[i * self.num_times + k];
        let both = seen(a).min(seen(b));
        (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * both * both
    }
}

impl Motion {
    const STILL: Self = Self { turn: [1.0, 0.0, 0.0, 0.0], from: [0.0; 3], to: [0.0; 3] };
}

/// Where a point goes with one cell, over the key times.
#[derive(Debug)]
pub(super) struct Path {
    cell: usize,
    from: [f32; 3],
    places: Vec<[f32; 3]>,
}

struct Fit {
    sums: RigidFit,
    from: [f64; 3],
    to: [f64; 3],
}

impl Fit {
    fn into_motion(self, prior: f64) -> Motion {
        Motion {
            turn: self.sums.rotation(prior).map(f32::from_double),
            from: self.from.map(f32::from_double),
            to: self.to.map(f32::from_double),
        }
    }
}

fn fit(cloud: &Cloud, k: usize, stencil: &[(f64, usize)]) -> Fit {
    let (mut from, mut to, mut total) = ([0.0; 3], [0.0; 3], 0.0);
    // If all have faded, they keep their shares.
    let seen = |weight: f64, i: usize| weight * (cloud.seen(k, i) + FADED);
    for &(weight, i) in stencil {
        let weight = seen(weight, i);
        for a in 0..3 {
            from[a] += weight * cloud.means[i][a];
            to[a] += weight * cloud.means_t[k][i][a];
        }
        total += weight;
    }
    let (from, to) = (from.map(|v| v / total), to.map(|v| v / total));
    let mut sums = RigidFit::about(from, to);
    for &(weight, i) in stencil {
        let weight = seen(weight, i);
        sums.add(weight, cloud.means[i], cloud.means_t[k][i]);
        sums.add_rotation(weight, cloud.turns_t[k][i]);
    }
    Fit { sums, from, to }
}

/// How far own rotations may be trusted, 0 to 1, from a sample of neighbourhoods.
///
/// The mean own rotation of a neighbourhood and the one its positions show differ by the errors of both. That of the positions
/// follows from how well they fit; the remainder is what own rotations miss, and the two are weighted by the inverse of their
/// variances.
fn rotation_trust(
    cloud: &Cloud,
    floater: &[bool],
    stencil: &(impl Fn(usize) -> Vec<(f64, usize)> + Sync),
) -> f64 {
    let step = (cloud.len() / 2000).max(1);
    let compared: Vec<[f64; 2]> = (0..cloud.len())
        .into_par_iter()
        .step_by(step)
        .filter(|&i| !floater[i])
        .flat_map_iter(|i| {
            let stencil = stencil(i);
            (0..cloud.num_times()).map(move |k| {
                let fit = fit(cloud, k, &stencil);
                let (shown, own) = (fit.sums.rotation(0.0), fit.sums.rotation(1e6));
                let angle = 2.0 * quat::dot(shown, own).abs().min(1.0).acos();
                [angle * angle, rotation_variance(cloud, k, &stencil, &fit, shown)]
            })
        })
        .collect();
    let middle = |which: usize| median(&mut compared.iter().map(|c| c[which]).collect::<Vec<_>>());
    let (apart, positions) = (middle(0), middle(1));
    // Below a hundredth of a degree everything agrees.
    let missed = (apart - positions).max(positions / ROTATION_PRIOR).max(3e-8);
    (positions.max(1e-7) / missed / ROTATION_PRIOR).min(1.0)
}

/// Expected square of the angle, radians², by which a rotation fitted to the positions alone is wrong.
fn rotation_variance(
    cloud: &Cloud,
    k: usize,
    stencil: &[(f64, usize)],
    fit: &Fit,
    turn: [f64; 4],
) -> f64 {
    let (mut total, mut squares, mut spread, mut residual) = (0.0, 0.0, 0.0, 0.0);
    for &(weight, i) in stencil {
        let arm = sub(cloud.means[i], fit.from);
        let miss = sub(cloud.means_t[k][i], fit.sums.apply(turn, cloud.means[i]));
        total += weight;
        squares += weight * weight;
        spread += weight * dot(arm, arm);
        residual += weight * dot(miss, miss);
    }
    let effective = total * total / squares;
    // Three turns, each across two thirds of the spread; two points' worth of freedom is used up.
    let variance = 1.5 * residual / (spread * (effective - 2.0).max(1.0));
    if variance.is_finite() { variance } else { 0.0 }
}
