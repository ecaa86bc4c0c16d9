//! Regions of the source: cells of splats that move together, from the `anchors` crate, with their
//! centroids, rotations and mean normals.
//!
//! The distances that separate body parts (offsets of surfaces, contact zones) scale with the
//! figure, not with its splats. The size of regions is a fixed share of the figure's size, for any
//! number of splats; where splats are sparse, each is a separate region.

use super::normals::{RING, RingMean, thin_axis, typical_scatter};
use crate::keyframes::{FADED, KeyFrames};
use crate::pose::Pose;
use crate::rigid::{dot, norm, sub};
use crate::row_index::index;
use anchors::{CellParams, Cells, RigidNeighbors, Trajectories};
use gs_core::{Real, quat};
use rayon::prelude::*;

/// Lower bound of a splat's weight, so that neighbourhoods of invisible splats also have a motion.
pub(super) const MIN_OPACITY: f64 = 1e-3;

/// Power iterations for a mean axis. Normals within a region differ by less than 45°, so each
/// iteration at least halves the error.
const ITERATIONS: usize = 8;

/// Regions of the usable sources that are not outliers. A "point" is a position in `ids`.
#[derive(Debug)]
pub(super) struct Regions {
    /// Source rows of all points, by distance from the origin, `[N]`.
    pub(super) ids: Vec<usize>,
    /// Centres of all points, about the origin of the pose, world units, `[N]`.
    pub(super) means: Vec<[f64; 3]>,
    /// Opacities of all points, at least [`MIN_OPACITY`], `[N]`.
    pub(super) weights: Vec<f64>,
    /// Membership of points in regions.
    pub(super) cells: Cells,
    /// Centres of the members, region by region, for contiguous access.
    member_means: Vec<[f64; 3]>,
    /// Start of the members of each region in `member_means`, and the end of the last, `[R+1]`.
    starts: Vec<usize>,
    /// Centroids of the regions, `[R]`, and their positions at the key times.
    pub(super) centroids: Trajectories,
    /// Mean rotations of the regions since the edit frame, `wxyz`, `[R,T]`.
    pub(super) rotations: Vec<[f64; 4]>,
    /// Mean thin axis of each region, sign arbitrary, length = flatness, `[R]`.
    pub(super) axes: Vec<[f64; 3]>,
    /// [`typical_scatter`] of the thin axes of the moving points; `None` if they are balls.
    pub(super) scatter: Option<f64>,
    /// Number of points that belong to no region.
    pub(super) num_outliers: usize,
    /// Noise of the splats' trajectories, see [`RigidNeighbors::noise`].
    pub(super) noise: f64,
}

/// Trajectories of the usable sources. Static splats are given constant positions and are always
/// present: their displacements and fading are noise.
fn trajectories(
    keys: &KeyFrames,
    ids: &[usize],
    dynamic: &[bool],
    origin: [f64; 3],
) -> Trajectories {
    let pick = |means: &[[f32; 3]], i: usize| sub(means[i].map(f64::from), origin);
    let rest: Vec<[f64; 3]> = ids.iter().map(|&i| pick(&keys.at_edit.means, i)).collect();
    let num_times = keys.times.len();
    let mut moved = vec![[0.0; 3]; ids.len() * num_times];
    let places = moved.par_chunks_mut(num_times.max(1)).zip(ids).zip(&rest);
    places.with_min_len(256).for_each(|((places, &i), rest)| {
        for (place, means) in places.iter_mut().zip(&keys.means) {
            *place = if dynamic[i] { pick(means, i) } else { *rest };
        }
    });
    let present = |&i: &usize| {
        let dynamic = dynamic[i];
        (0..num_times).map(move |k| if dynamic { keys.seen(k, i) } else { 1.0 })
    };
    Trajectories {
        moved,
        presence: if keys.fades() { ids.iter().flat_map(present).collect() } else { Vec::new() },
        weights: ids.iter().map(|&i| opacity_weight(keys, i)).collect(),
        moving: ids.iter().map(|&i| dynamic[i]).collect(),
        rest,
    }
}

/// Opacity as a weight; splats without a finite opacity count as invisible.
fn opacity_weight(keys: &KeyFrames, i: usize) -> f64 {
    let opacity = f64::from(keys.at_edit.opacity(i));
    if opacity.is_finite() { opacity.max(MIN_OPACITY) } else { MIN_OPACITY }
}

impl Regions {
    /// Groups the sources `ids`, in order of their distance from the origin of `pose`, in cubes of
    /// edge `size` along its axes. All positions are relative to its origin.
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
        let moving: Vec<usize> =
            (0..ids.len()).filter(|&i| points.moving[i] && !outliers[i]).collect();
        let scatter = typical_scatter(moving.len(), |at| {
            let i = moving[at];
            let ring = neighbors.get(i).take(RING).map(|(neighbor, _)| neighbor.id);
            let members: Vec<u32> = std::iter::once(index(i)).chain(ring).collect();
            RingMean::of(normals[i], &members, &normals, &points.weights)
        });
        let starts = std::iter::once(0).chain(cells.members.iter().scan(0, |end, members| {
            *end += members.len();
            Some(*end)
        }));
        let all_members = cells.members.iter().flatten();
        Self {
            scatter,
            starts: starts.collect(),
            member_means: all_members.map(|&p| points.rest[p as usize]).collect(),
            centroids: centroids(&points, &cells.members),
            rotations: rotations(keys, &ids, &points, &cells.members),
            num_outliers: outliers.iter().filter(|&&o| o).count(),
            noise: neighbors.noise,
            means: points.rest,
            weights: points.weights,
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

    /// Their centres, as in [`Self::means`].
    pub(super) fn member_means(&self, i: usize) -> &[[f64; 3]] {
        &self.member_means[self.starts[i]..self.starts[i + 1]]
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

/// Weighted mean of the members of each region.
fn centroids(points: &Trajectories, members: &[Vec<u32>]) -> Trajectories {
    let num_times = points.num_times();
    let fades = !points.presence.is_empty();
    let rest_of = |members: &Vec<u32>| {
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for &p in members {
            add(&mut sum, points.weights[p as usize], points.rest[p as usize]);
            total += points.weights[p as usize];
        }
        sum.map(|c| c / total)
    };
    let rest: Vec<[f64; 3]> = members.par_iter().with_min_len(256).map(rest_of).collect();
    let moved_of = |(members, rest): (&Vec<u32>, &[f64; 3])| -> Vec<[f64; 3]> {
        let mut sums = vec![([0.0; 3], 0.0); num_times];
        for &p in members {
            let p = p as usize;
            for (k, ((sum, total), place)) in sums.iter_mut().zip(points.places(p)).enumerate() {
                // If splats fade, the centroid follows the members that are still present.
                let seen = if fades { points.present(k, p) + FADED } else { 1.0 };
                let weight = points.weights[p] * seen;
                add(sum, weight, sub(*place, points.rest[p]));
                *total += weight;
            }
        }
        let place = |(sum, total): ([f64; 3], f64)| [0, 1, 2].map(|a| rest[a] + sum[a] / total);
        sums.into_iter().map(place).collect()
    };
    let moved = members.par_iter().zip(&rest).with_min_len(256).flat_map_iter(moved_of).collect();
    let weight = |members: &Vec<u32>| members.iter().map(|&p| points.weights[p as usize]).sum();
    let present_of = |members: &Vec<u32>| -> Vec<f64> {
        let total: f64 = weight(members);
        let present =
            |k: usize, &p: &u32| points.weights[p as usize] * points.present(k, p as usize);
        let at = |k: usize| members.iter().map(|p| present(k, p)).sum::<f64>() / total;
        (0..num_times).map(at).collect()
    };
    Trajectories {
        moved,
        presence: if fades { members.iter().flat_map(present_of).collect() } else { Vec::new() },
        weights: members.iter().map(weight).collect(),
        moving: members
            .iter()
            .map(|members| members.iter().any(|&p| points.moving[p as usize]))
            .collect(),
        rest,
    }
}

fn add(sum: &mut [f64; 3], weight: f64, x: [f64; 3]) {
    for (sum, x) in sum.iter_mut().zip(x) {
        *sum += weight * x;
    }
}

/// Mean rotations of the regions since the edit frame, `wxyz`, `[R,T]`; splats that do not move
/// have the identity.
fn rotations(
    keys: &KeyFrames,
    ids: &[usize],
    points: &Trajectories,
    members: &[Vec<u32>],
) -> Vec<[f64; 4]> {
    let of_region = |members: &Vec<u32>| -> Vec<[f64; 4]> {
        let at = |rotations: &Vec<[f32; 4]>| {
            let own = |p: u32| {
                if points.moving[p as usize] { rotations[ids[p as usize]] } else { quat::IDENTITY }
            };
            let first = own(members[0]);
            let mut sum = [0.0; 4];
            for &p in members {
                let rotation = quat::align(own(p), first).map(Real::as_f64);
                for i in 0..4 {
                    sum[i] += points.weights[p as usize] * rotation[i];
                }
            }
            quat::normalize(sum)
        };
        keys.rotations.iter().map(at).collect()
    };
    members.par_iter().with_min_len(256).flat_map_iter(of_region).collect()
}
