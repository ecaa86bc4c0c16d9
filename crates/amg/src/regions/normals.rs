//! Outward normals of regions, from the thin axes of their splats.

use super::numeric::TINY;
use crate::rigid::{dot, sub};
use anchors::{Neighbor, RigidNeighbors, Trajectories};
use gs_core::{Splats, quat};
use rayon::prelude::*;

/// Rounds of the mean-field iteration: information spreads by one neighbourhood per round.
const ROUNDS: usize = 40;

/// Unit thin axis times flatness `1 − s₁/s₂` of the two smallest scales: 0 for a ball or needle, near
/// 1 for a disc.
pub(super) fn thin_axis(splats: &Splats, i: usize) -> [f64; 3] {
    let scale = splats.scale(i).map(f64::from);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| scale[a].total_cmp(&scale[b]));
    let (small, middle) = (scale[order[0]], scale[order[1]]);
    let flatness = if middle > 0.0 && middle.is_finite() { 1.0 - small / middle } else { 0.0 };
    let mut axis = [0.0; 3];
    axis[order[0]] = flatness;
    let q = quat::normalize(splats.quats[i].map(f64::from));
    if quat::dot(q, q) < 0.5 { axis } else { quat::rotate(q, axis) }
}

/// Inner product of `nj` and the mirror image of `ni` along `d`, times nearness. It is positive if
/// both normals point outwards: at both ends of a smooth arc, on two faces across a gap, and on both
/// faces of a plate.
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

/// Flips `axes` so that they point outwards. Only points that move as one are compared, so a limb
/// that touches another part in the edit frame has no effect on it.
pub(super) fn orient(regions: &Trajectories, neighbors: &RigidNeighbors, axes: &mut [[f64; 3]]) {
    let guess: Vec<f64> = (0..regions.len())
        .into_par_iter()
        .with_min_len(64)
        .map(|i| outwardness(regions, neighbors, i, axes[i]))
        .collect();
    let links: Vec<Vec<(u32, f64)>> = (0..regions.len())
        .into_par_iter()
        .with_min_len(64)
        .map(|i| {
            let link = |(n, agree): (Neighbor, f64)| {
                let j = n.id as usize;
                let d = sub(regions.rest[j], regions.rest[i]);
                // Distance to the 6th neighbour.
                let spacing =
                    neighbors.spacing[i].min(neighbors.spacing[j]) * std::f64::consts::SQRT_2;
                (n.id, agree * mirror_coupling(axes[i], axes[j], d, spacing))
            };
            neighbors.get(i).map(link).collect()
        })
        .collect();
    let mut sign: Vec<f64> = guess.iter().map(|g| g.tanh()).collect();
    for _ in 0..ROUNDS {
        sign = (0..sign.len())
            .into_par_iter()
            .with_min_len(512)
            .map(|i| {
                let field: f64 = links[i].iter().map(|&(j, c)| c * sign[j as usize]).sum();
                (field + guess[i]).tanh()
            })
            .collect();
    }
    for (axis, sign) in axes.iter_mut().zip(&sign) {
        if *sign < 0.0 {
            *axis = axis.map(|c| -c);
        }
    }
}

/// Share of the mass on the inner side of the axis, −1 to 1: the neighbours of a surface, and the
/// splats it encloses, lie on its inner side.
fn outwardness(
    regions: &Trajectories,
    neighbors: &RigidNeighbors,
    i: usize,
    axis: [f64; 3],
) -> f64 {
    // The point itself is the first of its neighbourhood.
    let (mut pull, mut total, mut reach) = (0.0, 1.0, 0.0_f64);
    for (n, weight) in neighbors.get(i) {
        reach = reach.max(n.distance_squared.sqrt());
        total += weight;
        pull += weight * dot(sub(regions.rest[n.id as usize], regions.rest[i]), axis);
    }
    if reach > 0.0 { -pull / (total * reach) } else { 0.0 }
}
