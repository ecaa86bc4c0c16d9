//! Cells: groups of neighbouring source splats that move as one and face the same way.
//!
//! What decides between body parts (offsets of surfaces, contact zones) has the size of the figure, not of its splats. Cells
//! give those decisions one scale whatever the number of splats; where splats are sparse, each is its own cell.

use super::cloud::{Cloud, Companions};
use super::surface::thin_axis;
use crate::keyframes::{FADED, KeyFrames};
use crate::pose::Pose;
use crate::rigid::sub;
use gs_core::{Real, quat};
use rayon::prelude::*;

/// Neighbours in one cell move at least this much as one.
const MIN_COMPANION: f64 = 0.5;

/// Cells of the usable, non-floating sources. "Point" is a position in `ids`.
#[derive(Debug)]
pub(super) struct Cells {
    /// Source rows of all points, from the inside out.
    pub(super) ids: Vec<usize>,
    /// Centres of all points.
    pub(super) means: Vec<[f64; 3]>,
    /// Points of each cell, ascending.
    pub(super) members: Vec<Vec<u32>>,
    /// Cell of each point; `u32::MAX` for floaters.
    pub(super) cell_of: Vec<u32>,
    /// Centroids of the cells.
    pub(super) cloud: Cloud,
    /// Mean thin axis of each cell, sign arbitrary, length = flatness.
    pub(super) axes: Vec<[f64; 3]>,
    pub(super) num_floaters: usize,
    /// That of the sources' trajectories, see [`Companions`].
    pub(super) noise: f64,
}

/// The usable sources as a cloud. Those that do not move are where they were: what they show is noise.
fn dense_cloud(keys: &KeyFrames, ids: &[usize], dynamic: &[bool], origin: [f64; 3]) -> Cloud {
    let pick = |means: &[[f32; 3]], i: usize| sub(means[i].map(f64::from), origin);
    // Still splats are where they were, seen or not.
    let seen_at =
        |k: usize| ids.iter().map(|&i| if dynamic[i] { keys.seen(k, i) } else { 1.0 }).collect();
    let seen = if keys.fades() { (0..keys.times.len()).map(seen_at).collect() } else { Vec::new() };
    let still: Vec<[f64; 3]> = ids.iter().map(|&i| pick(&keys.at_edit.means, i)).collect();
    let moved = |means: &Vec<[f32; 3]>| {
        ids.iter()
            .zip(&still)
            .map(|(&i, still)| if dynamic[i] { pick(means, i) } else { *still })
            .collect()
    };
    Cloud {
        means_t: keys.means.iter().map(moved).collect(),
        means: still,
        turns_t: Vec::new(),
        seen_t: seen,
        opacity: ids.iter().map(|&i| opacity_weight(keys, i)).collect(),
        moving: ids.iter().map(|&i| dynamic[i]).collect(),
    }
}

/// Opacity as a weight: an invisible splat still says a little about how its surroundings move.
pub(super) fn opacity_weight(keys: &KeyFrames, i: usize) -> f64 {
    let opacity = f64::from(keys.at_edit.opacity(i));
    if opacity.is_finite() { opacity.max(1e-3) } else { 1e-3 }
}

impl Cells {
    /// Groups the sources `ids` (from the inside out) in cubes of edge `size` along the axes of `pose`. Everything is about its
    /// origin.
    pub(super) fn of(
        keys: &KeyFrames,
        ids: Vec<usize>,
        dynamic: &[bool],
        pose: &Pose,
        size: f64,
    ) -> Self {
        let dense = dense_cloud(keys, &ids, dynamic, pose.origin);
        let companions = Companions::of(&dense);
        let floater = companions.floaters(&dense);
        let normals: Vec<[f64; 3]> =
            ids.par_iter().with_min_len(256).map(|&i| thin_axis(&keys.at_edit, i)).collect();
        let members = group(&dense, &companions, &floater, &normals, pose, size);
        let mut cell_of = vec![u32::MAX; ids.len()];
        for (cell, points) in members.iter().enumerate() {
            for &point in points {
                cell_of[point as usize] = crate::binding::index(cell);
            }
        }
        let axes = members
            .par_iter()
            .with_min_len(64)
            .map(|points| mean_axis(points, &normals, &dense.opacity))
            .collect();
        let cloud = centroids(keys, &ids, &dense, &members);
        let num_floaters = floater.iter().filter(|&&f| f).count();
        Self {
            means: dense.means,
            ids,
            members,
            cell_of,
            cloud,
            axes,
            num_floaters,
            noise: companions.noise,
        }
    }
}

fn group(
    dense: &Cloud,
    companions: &Companions,
    floater: &[bool],
    normals: &[[f64; 3]],
    pose: &Pose,
    size: f64,
) -> Vec<Vec<u32>> {
    let num = dense.len();
    let typical = companions.typical_spacing(dense);
    // Sparse clouds stay as they are: merging two of their splats would lose more than it steadies.
    let edge = if 1.5 * typical < size { size } else { 0.0 };
    // Rounded, the lattice is its own mirror image: signs and order of the axes do not matter.
    let cube = |i: usize| pose.along(dense.means[i]).map(|c| (c / edge).round());
    let mut root: Vec<usize> = (0..num).collect();
    if edge > 0.0 {
        for i in 0..num {
            for (neighbor, agree) in companions.near[i].iter().zip(&companions.agree[i]) {
                let j = neighbor.id as usize;
                let joined = i != j
                    && !floater[i]
                    && !floater[j]
                    && *agree >= MIN_COMPANION
                    && cube(i) == cube(j)
                    && same_sheet(normals[i], normals[j]);
                if joined {
                    let (a, b) = (find(&mut root, i), find(&mut root, j));
                    root[a.max(b)] = a.min(b);
                }
            }
        }
    }
    let mut cell = vec![usize::MAX; num];
    let mut members: Vec<Vec<u32>> = Vec::new();
    for i in (0..num).filter(|&i| !floater[i]) {
        let head = find(&mut root, i);
        if cell[head] == usize::MAX {
            cell[head] = members.len();
            members.push(Vec::new());
        }
        members[cell[head]].push(crate::binding::index(i));
    }
    members
}

fn find(root: &mut [usize], mut i: usize) -> usize {
    while root[i] != i {
        root[i] = root[root[i]];
        i = root[i];
    }
    i
}

/// Whether two thin axes differ by less than 45°; balls go with anything.
fn same_sheet(a: [f64; 3], b: [f64; 3]) -> bool {
    let inner = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (aa, bb, ab) = (inner(a, a), inner(b, b), inner(a, b));
    aa < 0.09 || bb < 0.09 || ab * ab >= 0.5 * aa * bb
}

/// Principal axis of `Σ w n nᵀ`, times the mean length of the normals along it.
fn mean_axis(points: &[u32], normals: &[[f64; 3]], weights: &[f64]) -> [f64; 3] {
    let length = |n: [f64; 3]| (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    let first = points.iter().fold([0.0; 3], |best, &p| {
        if length(normals[p as usize]) > length(best) { normals[p as usize] } else { best }
    });
    if points.len() == 1 || length(first) == 0.0 {
        return first;
    }
    let mut axis = first.map(|c| c / length(first));
    let (mut sum, mut total) = (0.0, 0.0);
    for _ in 0..8 {
        let mut next = [0.0; 3];
        (sum, total) = (0.0, 0.0);
        for &p in points {
            let (n, w) = (normals[p as usize], weights[p as usize]);
            let along = n[0] * axis[0] + n[1] * axis[1] + n[2] * axis[2];
            for a in 0..3 {
                next[a] += w * along * n[a];
            }
            sum += w * along.abs();
            total += w;
        }
        let size = length(next);
        if size > 0.0 {
            axis = next.map(|c| c / size);
        }
    }
    axis.map(|c| c * sum / total)
}

fn centroids(keys: &KeyFrames, ids: &[usize], dense: &Cloud, members: &[Vec<u32>]) -> Cloud {
    let mean_of = |means: &[[f64; 3]]| -> Vec<[f64; 3]> {
        members
            .par_iter()
            .with_min_len(256)
            .map(|points| {
                let (mut sum, mut total) = ([0.0; 3], 0.0);
                for &p in points {
                    let w = dense.opacity[p as usize];
                    for a in 0..3 {
                        sum[a] += w * means[p as usize][a];
                    }
                    total += w;
                }
                sum.map(|c| c / total)
            })
            .collect()
    };
    // Follows the members that are still there.
    let moved = |k: usize, rest: &[[f64; 3]]| -> Vec<[f64; 3]> {
        if dense.seen_t.is_empty() {
            return mean_of(&dense.means_t[k]);
        }
        let one = |(points, rest): (&Vec<u32>, &[f64; 3])| {
            let (mut sum, mut total) = ([0.0; 3], 0.0);
            for &p in points {
                let p = p as usize;
                let w = dense.opacity[p] * (dense.seen(k, p) + FADED);
                for a in 0..3 {
                    sum[a] += w * (dense.means_t[k][p][a] - dense.means[p][a]);
                }
                total += w;
            }
            [0, 1, 2].map(|a| rest[a] + sum[a] / total)
        };
        members.par_iter().zip(rest).with_min_len(256).map(one).collect()
    };
    let seen_of = |k: usize| -> Vec<f64> {
        let one = |points: &Vec<u32>| {
            let (mut sum, mut total) = (0.0, 0.0);
            for &p in points {
                sum += dense.opacity[p as usize] * dense.seen(k, p as usize);
                total += dense.opacity[p as usize];
            }
            sum / total
        };
        members.iter().map(one).collect()
    };
    let turn_of = |turns: &Vec<[f32; 4]>| -> Vec<[f64; 4]> {
        members
            .par_iter()
            .with_min_len(256)
            .map(|points| {
                let own = |p: u32| {
                    if dense.moving[p as usize] { turns[ids[p as usize]] } else { quat::IDENTITY }
                };
                let first = own(points[0]);
                let mut sum = [0.0; 4];
                for &p in points {
                    let turn = quat::align(own(p), first).map(Real::as_f64);
                    for i in 0..4 {
                        sum[i] += dense.opacity[p as usize] * turn[i];
                    }
                }
                quat::normalize(sum)
            })
            .collect()
    };
    let means = mean_of(&dense.means);
    Cloud {
        means_t: (0..keys.times.len()).map(|k| moved(k, &means)).collect(),
        seen_t: (0..dense.seen_t.len()).map(seen_of).collect(),
        means,
        turns_t: keys.turns.iter().map(turn_of).collect(),
        opacity: members
            .iter()
            .map(|points| points.iter().map(|&p| dense.opacity[p as usize]).sum::<f64>())
            .collect(),
        moving: members
            .iter()
            .map(|points| points.iter().any(|&p| dense.moving[p as usize]))
            .collect(),
    }
}
