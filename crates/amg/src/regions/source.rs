//! Regions of the source: cells of splats that move as one, from the `anchors` crate, and what is known of each.
//!
//! What decides between body parts (offsets of surfaces, contact zones) has the size of the figure, not of its splats. Regions
//! give those decisions one scale whatever the number of splats; where splats are sparse, each is its own region.

use super::normals::thin_axis;
use crate::keyframes::{FADED, KeyFrames};
use crate::pose::Pose;
use crate::rigid::{dot, norm, sub};
use anchors::{CellParams, Cells, RigidNeighbors, Trajectories};
use gs_core::{Real, quat};
use rayon::prelude::*;

/// Least weight of a splat: an invisible one still says a little about how its surroundings move.
const LEAST_OPACITY: f64 = 1e-3;

/// Power iterations for a mean axis. Normals within a region differ by less than 45°: each iteration at least halves the error.
const ITERATIONS: usize = 8;

/// Regions of the usable sources that are no outliers. "Point" is a position in `ids`.
#[derive(Debug)]
pub(super) struct Regions {
    /// Source rows of all points, from the inside out.
    pub(super) ids: Vec<usize>,
    /// Centres of all points.
    pub(super) means: Vec<[f64; 3]>,
    /// Who belongs to which region.
    pub(super) cells: Cells,
    /// Centroids of the regions.
    pub(super) centroids: Trajectories,
    /// Mean rotations of the regions since the edit frame, `wxyz`, `[T][R]`.
    pub(super) turns: Vec<Vec<[f64; 4]>>,
    /// Mean thin axis of each region, sign arbitrary, length = flatness.
    pub(super) axes: Vec<[f64; 3]>,
    pub(super) num_outliers: usize,
    /// That of the splats' trajectories, see [`RigidNeighbors::noise`].
    pub(super) noise: f64,
}

/// The usable sources. Those that do not move are where they were, seen or not: what they show is noise.
fn trajectories(
    keys: &KeyFrames,
    ids: &[usize],
    dynamic: &[bool],
    origin: [f64; 3],
) -> Trajectories {
    let pick = |means: &[[f32; 3]], i: usize| sub(means[i].map(f64::from), origin);
    let present_at =
        |k: usize| ids.iter().map(|&i| if dynamic[i] { keys.seen(k, i) } else { 1.0 }).collect();
    let rest: Vec<[f64; 3]> = ids.iter().map(|&i| pick(&keys.at_edit.means, i)).collect();
    let moved = |means: &Vec<[f32; 3]>| {
        let place = |(&i, rest): (&usize, &[f64; 3])| {
            if dynamic[i] { pick(means, i) } else { *rest }
        };
        ids.iter().zip(&rest).map(place).collect()
    };
    let num_fading = if keys.fades() { keys.times.len() } else { 0 };
    Trajectories {
        moved: keys.means.iter().map(moved).collect(),
        presence: (0..num_fading).map(present_at).collect(),
        weights: ids.iter().map(|&i| opacity_weight(keys, i)).collect(),
        moving: ids.iter().map(|&i| dynamic[i]).collect(),
        rest,
    }
}

/// Opacity as a weight.
pub(super) fn opacity_weight(keys: &KeyFrames, i: usize) -> f64 {
    let opacity = f64::from(keys.at_edit.opacity(i));
    if opacity.is_finite() { opacity.max(LEAST_OPACITY) } else { LEAST_OPACITY }
}

impl Regions {
    /// Groups the sources `ids` (from the inside out) in cubes of edge `size` along the axes of `pose`. Everything is about its
    /// origin.
    pub(super) fn of(
        keys: &KeyFrames,
        ids: Vec<usize>,
        dynamic: &[bool],
        pose: &Pose,
        (size, strain): (f64, f64),
    ) -> Self {
        let points = trajectories(keys, &ids, dynamic, pose.origin);
        let neighbors = RigidNeighbors::of(&points, strain);
        let outliers = neighbors.outliers(&points);
        let normals: Vec<[f64; 3]> =
            ids.par_iter().with_min_len(256).map(|&i| thin_axis(&keys.at_edit, i)).collect();
        let lattice = CellParams { edge: size, axes: pose.axes };
        let cells = Cells::build(&points, &neighbors, &outliers, &normals, &lattice);
        let axes = cells
            .members
            .par_iter()
            .with_min_len(64)
            .map(|members| mean_axis(members, &normals, &points.weights))
            .collect();
        Self {
            centroids: centroids(&points, &cells.members),
            turns: turns(keys, &ids, &points, &cells.members),
            num_outliers: outliers.iter().filter(|&&o| o).count(),
            noise: neighbors.noise,
            means: points.rest,
            ids,
            cells,
            axes,
        }
    }

    /// Number of regions.
    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    /// Points of region `i`.
    pub(super) fn members(&self, i: usize) -> &[u32] {
        &self.cells.members[i]
    }
}

/// Principal axis of `Σ w n nᵀ`, times the mean length of the normals along it.
fn mean_axis(members: &[u32], normals: &[[f64; 3]], weights: &[f64]) -> [f64; 3] {
    let first = members.iter().fold([0.0; 3], |best, &p| {
        let normal = normals[p as usize];
        if dot(normal, normal) > dot(best, best) { normal } else { best }
    });
    let length = norm(first);
    if members.len() == 1 || length == 0.0 {
        return first;
    }
    let mut axis = first.map(|c| c / length);
    let (mut sum, mut total) = (0.0, 0.0);
    for _ in 0..ITERATIONS {
        let mut next = [0.0; 3];
        (sum, total) = (0.0, 0.0);
        for &p in members {
            let (n, w) = (normals[p as usize], weights[p as usize]);
            let along = dot(n, axis);
            for a in 0..3 {
                next[a] += w * along * n[a];
            }
            sum += w * along.abs();
            total += w;
        }
        let size = norm(next);
        if size > 0.0 {
            axis = next.map(|c| c / size);
        }
    }
    axis.map(|c| c * sum / total)
}

/// Weighted mean of a vector over the members of a region.
fn mean_of(members: &[u32], weights: &[f64], value: impl Fn(usize) -> [f64; 3]) -> [f64; 3] {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for &p in members {
        let (weight, value) = (weights[p as usize], value(p as usize));
        for a in 0..3 {
            sum[a] += weight * value[a];
        }
        total += weight;
    }
    sum.map(|c| c / total)
}

fn centroids(points: &Trajectories, members: &[Vec<u32>]) -> Trajectories {
    let each = |value: &(dyn Fn(usize) -> [f64; 3] + Sync)| -> Vec<[f64; 3]> {
        let mean = |members: &Vec<u32>| mean_of(members, &points.weights, value);
        members.par_iter().with_min_len(256).map(mean).collect()
    };
    let rest = each(&|p| points.rest[p]);
    let fades = !points.presence.is_empty();
    // Where splats fade, the centroid follows the members that are still there.
    let moved = |k: usize| -> Vec<[f64; 3]> {
        let moved = &points.moved[k];
        if !fades {
            return each(&|p| moved[p]);
        }
        let one = |(members, rest): (&Vec<u32>, &[f64; 3])| {
            let (mut sum, mut total) = ([0.0; 3], 0.0);
            for &p in members {
                let p = p as usize;
                let weight = points.weights[p] * (points.present(k, p) + FADED);
                let step = sub(moved[p], points.rest[p]);
                for a in 0..3 {
                    sum[a] += weight * step[a];
                }
                total += weight;
            }
            [0, 1, 2].map(|a| rest[a] + sum[a] / total)
        };
        members.par_iter().zip(&rest).with_min_len(256).map(one).collect()
    };
    let weight = |members: &Vec<u32>| members.iter().map(|&p| points.weights[p as usize]).sum();
    let present = |k: usize| -> Vec<f64> {
        let one = |members: &Vec<u32>| {
            let present = |&p: &u32| points.weights[p as usize] * points.present(k, p as usize);
            let total: f64 = weight(members);
            members.iter().map(present).sum::<f64>() / total
        };
        members.iter().map(one).collect()
    };
    Trajectories {
        moved: (0..points.num_times()).map(moved).collect(),
        presence: (0..points.presence.len()).map(present).collect(),
        weights: members.iter().map(weight).collect(),
        moving: members
            .iter()
            .map(|members| members.iter().any(|&p| points.moving[p as usize]))
            .collect(),
        rest,
    }
}

/// Mean relative rotations of the regions; those of splats that do not move are none.
fn turns(
    keys: &KeyFrames,
    ids: &[usize],
    points: &Trajectories,
    members: &[Vec<u32>],
) -> Vec<Vec<[f64; 4]>> {
    let at = |turns: &Vec<[f32; 4]>| -> Vec<[f64; 4]> {
        let own = |p: u32| {
            if points.moving[p as usize] { turns[ids[p as usize]] } else { quat::IDENTITY }
        };
        let mean = |members: &Vec<u32>| {
            let first = own(members[0]);
            let mut sum = [0.0; 4];
            for &p in members {
                let turn = quat::align(own(p), first).map(Real::as_f64);
                for i in 0..4 {
                    sum[i] += points.weights[p as usize] * turn[i];
                }
            }
            quat::normalize(sum)
        };
        members.par_iter().with_min_len(256).map(mean).collect()
    };
    keys.turns.iter().map(at).collect()
}
