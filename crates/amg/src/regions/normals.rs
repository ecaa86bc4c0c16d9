//! Thin axes of splats, their noise, and the outward normals of regions.

use super::numeric::TINY;
use crate::rigid::{dot, norm, sub};
use anchors::{Neighbor, Neighbors, RigidNeighbors, Trajectories};
use gs_core::{Splats, quantile, quat};
use rayon::prelude::*;

/// Numbers of neighbours whose centre of mass indicates the inner side, on two scales.
const INSIDE: [usize; 2] = [24, 96];

/// Number of neighbours over which thin axes are compared and averaged: the ring around a splat on
/// a surface.
pub(super) const RING: usize = 6;

/// Iterations for the mean axis of a ring; 8 change the motion of a fitted edit by 0.2 %, 2 by 2 %.
const ITERATIONS: usize = 4;

/// Share of a surface that is assumed to be smooth: at creases, axes differ even without noise. 0.1
/// and 0.5 change the motion of a fitted edit by at most 0.2 %.
const SMOOTH_SHARE: f64 = 0.25;

/// Number of splats of which a quantile is taken; its standard error is then about 1 %.
const SAMPLES: usize = 10_000;

/// Rounds of mean-field annealing of the signs, with inverse temperatures from `BETA[0]` to
/// `BETA[1]`. The weight of the guess from the centre of mass falls from [`GUESS`] to a tenth of
/// it, so that the coupling of neighbours dominates at the end.
const ROUNDS: i32 = 40;
const GUESS: f64 = 2.0;
const BETA: [f64; 2] = [0.5, 4.0];

/// Unit thin axis times flatness `1 − s₁/s₂` of the two smallest scales: 0 for a ball or needle,
/// nearly 1 for a disc.
pub(super) fn thin_axis(splats: &Splats, i: usize) -> [f64; 3] {
    let scale = splats.scale(i).map(f64::from);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| scale[a].total_cmp(&scale[b]));
    let (small, middle) = (scale[order[0]], scale[order[1]]);
    let is_valid = middle > 0.0 && middle.is_finite();
    // `max` converts NaN to 0.
    let flatness = if is_valid { (1.0 - small / middle).max(0.0) } else { 0.0 };
    let mut axis = [0.0; 3];
    axis[order[0]] = flatness;
    let q = quat::normalize(splats.quats[i].map(f64::from));
    if quat::dot(q, q) < 0.5 { axis } else { quat::rotate(q, axis) }
}

/// Thin axes around one splat.
#[derive(Debug, Clone, Copy)]
pub(super) struct RingMean {
    /// Mean axis; its length is the mean flatness along it.
    pub(super) axis: [f64; 3],
    /// `1 − length / mean flatness`: 0 if the axes are parallel.
    pub(super) scatter: f64,
}

impl RingMean {
    /// Mean of the axes of `members`, starting from the axis `own`; each has the weight `w cos²` of
    /// its angle to the mean, so that the other faces at an edge of the surface have little
    /// influence. `None` for a ball.
    pub(super) fn of(
        own: [f64; 3],
        members: &[u32],
        axes: &[[f64; 3]],
        weights: &[f64],
    ) -> Option<Self> {
        let length = norm(own);
        if length == 0.0 {
            return None;
        }
        let mut mean = own.map(|c| c / length);
        let (mut along_mean, mut flatness, mut total) = (0.0, 0.0, 0.0);
        for _ in 0..ITERATIONS {
            let mut next = [0.0; 3];
            (along_mean, flatness, total) = (0.0, 0.0, 0.0);
            for &member in members {
                let axis = axes[member as usize];
                let along = dot(axis, mean);
                let weight = weights[member as usize] * along * along;
                for (next, c) in next.iter_mut().zip(axis) {
                    *next += weight * along * c;
                }
                along_mean += weight * along.abs();
                flatness += weight * norm(axis);
                total += weight;
            }
            let length = norm(next);
            if length == 0.0 {
                return None;
            }
            mean = next.map(|c| c / length);
        }
        let scatter = (1.0 - along_mean / flatness).max(0.0);
        Some(Self { axis: mean.map(|c| c * along_mean / total), scatter })
    }
}

/// Lower quartile of the scatter of at most [`SAMPLES`] of `count` splats. `None` if all of them
/// are balls.
pub(super) fn typical_scatter(
    count: usize,
    ring: impl Fn(usize) -> Option<RingMean> + Sync + Send,
) -> Option<f64> {
    let step = count.div_ceil(SAMPLES).max(1);
    let sample: Vec<usize> = (0..count).step_by(step).collect();
    let mut found: Vec<f64> =
        sample.into_par_iter().filter_map(|i| Some(ring(i)?.scatter)).collect();
    quantile(&mut found, SMOOTH_SHARE)
}

/// Inner product of `nj` and the mirror image of `ni` in the plane across `d`, times nearness. It
/// is positive for the two ends of a smooth arc, for two faces on either side of a gap, and for
/// both faces of a plate, if all normals point outwards.
fn mirror_coupling(ni: [f64; 3], nj: [f64; 3], d: [f64; 3], spacing: f64) -> f64 {
    let squared = dot(d, d);
    if squared <= 0.0 {
        return dot(ni, nj);
    }
    let along = dot(ni, d) / squared;
    let mirrored = [0, 1, 2].map(|a| ni[a] - 2.0 * along * d[a]);
    let reach = (2.0 * spacing).max(TINY);
    dot(mirrored, nj) * (-0.5 * squared / (reach * reach)).exp()
}

/// Flips `axes` `[R]` so that they point outwards. Couplings are weighted by agreement of motion,
/// so that a limb does not affect the part that it touches at the edit frame.
pub(super) fn orient(regions: &Trajectories, neighbors: &RigidNeighbors, axes: &mut [[f64; 3]]) {
    let wide = Neighbors::of(&regions.rest, INSIDE[1]);
    let guess: Vec<f64> = (0..regions.len())
        .into_par_iter()
        .with_min_len(64)
        .map(|i| {
            let near: Vec<Neighbor> = wide.get(i).collect();
            let agree: Vec<f64> =
                near.iter().map(|n| neighbors.between(regions, i, n.id as usize)).collect();
            INSIDE.iter().map(|&count| outwardness(regions, i, axes[i], &near, &agree, count)).sum()
        })
        .collect();
    let links: Vec<Vec<(u32, f64)>> = (0..regions.len())
        .into_par_iter()
        .with_min_len(64)
        .map(|i| {
            let link = |(n, agree): (Neighbor, f64)| {
                let j = n.id as usize;
                let d = sub(regions.rest[j], regions.rest[i]);
                // Distance of the sixth neighbour.
                let spacing =
                    neighbors.spacing[i].min(neighbors.spacing[j]) * std::f64::consts::SQRT_2;
                (n.id, agree * mirror_coupling(axes[i], axes[j], d, spacing))
            };
            neighbors.get(i).map(link).collect()
        })
        .collect();
    let mut sign: Vec<f64> = guess.iter().map(|g| (GUESS * g).tanh()).collect();
    for round in 0..ROUNDS {
        let done = f64::from(round) / f64::from(ROUNDS);
        let beta = BETA[0] * (BETA[1] / BETA[0]).powf(done);
        let fade = GUESS * 0.1_f64.powf(done);
        sign = (0..sign.len())
            .into_par_iter()
            .with_min_len(512)
            .map(|i| {
                let field: f64 = links[i].iter().map(|&(j, c)| c * sign[j as usize]).sum();
                (beta * (field + fade * guess[i])).tanh()
            })
            .collect();
    }
    for (axis, sign) in axes.iter_mut().zip(&sign) {
        if *sign < 0.0 {
            *axis = axis.map(|c| -c);
        }
    }
}

/// Share of the neighbours' mass behind the axis, −1 to 1: the neighbours of a surface, and what it
/// encloses, lie on its inner side.
fn outwardness(
    regions: &Trajectories,
    i: usize,
    axis: [f64; 3],
    near: &[Neighbor],
    agree: &[f64],
    count: usize,
) -> f64 {
    let near = &near[..near.len().min(count)];
    let reach = near.last().map_or(0.0, |n| n.distance_squared.sqrt());
    // The point itself is the first of its neighbourhood.
    let (mut pull, mut total) = (0.0, 1.0);
    for (n, weight) in near.iter().zip(agree) {
        total += weight;
        pull += weight * dot(sub(regions.rest[n.id as usize], regions.rest[i]), axis);
    }
    if reach > 0.0 { -pull / (total * reach) } else { 0.0 }
}
