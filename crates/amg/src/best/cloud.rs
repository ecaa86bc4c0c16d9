//! Points with trajectories, and which neighbours move as one.

use crate::rigid::{norm, sub};
use anchors::{KdTree, Neighbor};
use rayon::prelude::*;

/// Neighbours per point.
pub(super) const NEIGHBORS: usize = 24;

/// Points that share no more than this of their neighbourhood's weight with rigid companions are floaters.
const MIN_SUPPORT: f64 = 0.3;

/// Change of distance between two rigid companions, relative to their distance, that a soft body is allowed.
const STRAIN: f64 = 0.04;

/// Stands in for lengths that are zero; its square is a positive number, too.
pub(super) const TINY: f64 = 1e-100;

/// Points at the edit frame and at the key times.
#[derive(Debug, Default)]
pub(super) struct Cloud {
    /// `[N]`.
    pub(super) means: Vec<[f64; 3]>,
    /// `[T][N]`.
    pub(super) means_t: Vec<Vec<[f64; 3]>>,
    /// Relative rotations `wxyz`, w ≥ 0, `[T][N]`.
    pub(super) turns_t: Vec<Vec<[f64; 4]>>,
    /// How far each point is still there, 0 to 1, `[T][N]`; empty if all always are. Where a splat would be once it has faded was
    /// fitted to nothing.
    pub(super) seen_t: Vec<Vec<f64>>,
    /// Weights: opacities.
    pub(super) opacity: Vec<f64>,
    /// Which points move at all. Noise and spacing are those of the moving object: a still background has neither its
    /// noise nor its density.
    pub(super) moving: Vec<bool>,
}

/// Neighbourhoods of a [`Cloud`].
#[derive(Debug)]
pub(super) struct Companions {
    /// Nearest points, self first, `[N][≤ 25]`.
    pub(super) near: Vec<Vec<Neighbor>>,
    /// How far each of them moves as one with the point, 0 to 1.
    pub(super) agree: Vec<Vec<f64>>,
    /// Local spacing, world units: distance to the 6th neighbour over √2, `[N]`.
    pub(super) spacing: Vec<f64>,
    /// Median change of distance between close neighbours over time: the noise of the trajectories, world units.
    pub(super) noise: f64,
}

impl Cloud {
    pub(super) fn len(&self) -> usize {
        self.means.len()
    }

    pub(super) fn num_times(&self) -> usize {
        self.means_t.len()
    }

    /// How far point `i` is still there at key time `k`.
    pub(super) fn seen(&self, k: usize, i: usize) -> f64 {
        self.seen_t.get(k).map_or(1.0, |seen| seen[i])
    }

    /// Largest change over time of the distance between `a` and `b`, as far as both are seen.
    fn deviation(&self, a: usize, b: usize, rest: f64) -> f64 {
        self.means_t.iter().enumerate().fold(0.0_f64, |worst, (k, means)| {
            let change = (norm(sub(means[a], means[b])) - rest).abs();
            worst.max(change * self.seen(k, a).min(self.seen(k, b)))
        })
    }

    /// How far `a` and `b` move as one: 1 if their distance never changes, 0 if it does.
    pub(super) fn companion(&self, a: usize, b: usize, noise: f64) -> f64 {
        let rest = norm(sub(self.means[a], self.means[b]));
        agreement(self.deviation(a, b, rest), rest, noise)
    }
}

fn agreement(deviation: f64, rest: f64, noise: f64) -> f64 {
    let stiff = 3.0 * noise + STRAIN * rest;
    if stiff > 0.0 { (-0.5 * (deviation / stiff).powi(2)).exp() } else { 1.0 }
}

impl Companions {
    pub(super) fn of(cloud: &Cloud) -> Self {
        let near = nearest(&cloud.means, NEIGHBORS + 1);
        let spacing = spacing(&near);
        let deviations: Vec<Vec<f64>> = near
            .par_iter()
            .enumerate()
            .with_min_len(256)
            .map(|(i, near)| {
                let one =
                    |n: &Neighbor| cloud.deviation(i, n.id as usize, n.distance_squared.sqrt());
                near.iter().map(one).collect()
            })
            .collect();
        let mut pooled: Vec<f64> = deviations
            .iter()
            .zip(&cloud.moving)
            .filter(|(_, moving)| **moving)
            .flat_map(|(d, _)| d.iter().skip(1).take(8).copied())
            .collect();
        let noise = median(&mut pooled);
        let agree = near
            .iter()
            .zip(deviations)
            .map(|(near, deviations)| {
                let one = |(n, d): (&Neighbor, f64)| agreement(d, n.distance_squared.sqrt(), noise);
                near.iter().zip(deviations).map(one).collect()
            })
            .collect();
        Self { near, agree, spacing, noise }
    }

    /// Median spacing of the moving points.
    pub(super) fn typical_spacing(&self, cloud: &Cloud) -> f64 {
        let moving = self.spacing.iter().zip(&cloud.moving).filter(|(_, moving)| **moving);
        median(&mut moving.map(|(spacing, _)| *spacing).collect::<Vec<f64>>())
    }

    /// Weight of the `slot`-th neighbour of `i` by distance and opacity alone.
    pub(super) fn spatial(&self, cloud: &Cloud, i: usize, slot: usize) -> f64 {
        let neighbor = self.near[i][slot];
        let reach = (2.0 * self.spacing[i]).max(TINY);
        cloud.opacity[neighbor.id as usize]
            * (-0.5 * neighbor.distance_squared / (reach * reach)).exp()
    }

    /// Points whose neighbours do not move with them.
    pub(super) fn floaters(&self, cloud: &Cloud) -> Vec<bool> {
        (0..cloud.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let (mut kept, mut all) = (0.0, 0.0);
                for slot in 1..self.near[i].len() {
                    let spatial = self.spatial(cloud, i, slot);
                    kept += spatial * self.agree[i][slot];
                    all += spatial;
                }
                all > 0.0 && kept <= MIN_SUPPORT * all
            })
            .collect()
    }
}

/// The `k` nearest points of each point, itself first.
pub(super) fn nearest(means: &[[f64; 3]], k: usize) -> Vec<Vec<Neighbor>> {
    let tree = KdTree::<3>::new(means);
    means
        .par_iter()
        .with_min_len(256)
        .map(|x| {
            let mut near = Vec::with_capacity(k);
            tree.nearest(x, k, &mut near);
            near
        })
        .collect()
}

/// Distance to the 6th neighbour over √2, per point.
pub(super) fn spacing(near: &[Vec<Neighbor>]) -> Vec<f64> {
    let one = |near: &Vec<Neighbor>| {
        near.get(near.len().min(7).saturating_sub(1)).map_or(0.0, |n| n.distance_squared.sqrt())
            / std::f64::consts::SQRT_2
    };
    near.iter().map(one).collect()
}

/// The middle value, 0 of nothing. Reorders.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
