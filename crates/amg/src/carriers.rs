//! Splits the splats that the edit moved into rigid groups, and chooses the source splats whose
//! motion each group follows (its carriers).

use crate::identity::{Identity, IdentityMap};
use crate::keyframes::{FADED, KeyFrames};
use crate::moved_group::MovedGroup;
use crate::rigid::{RigidFit, norm, sub};
use crate::row_index::index;
use anchors::KdTree;
use gs_core::Real;

/// Neighbours whose distances are compared over time.
const NEIGHBORS: usize = 7;
/// Distances within a rigid piece change by less than this share of the group's size, or of the
/// distance itself.
const OF_SIZE: f64 = 0.04;
const OF_DISTANCE: f64 = 0.75;
/// Minimum number of splats of a piece; smaller ones join the nearest piece.
const MIN_PIECE: usize = 12;
/// Maximum number of carriers of a group; more do not change the mean motion.
const MAX_CARRIERS: usize = 192;
/// Rounds of the robust fit.
const ROUNDS: usize = 4;

/// Groups of a binding, and the group of each moved row.
pub(crate) struct Groups {
    pub(crate) groups: Vec<MovedGroup>,
    /// Index into `groups` per edited row; only those of moved rows count.
    pub(crate) of_row: Vec<u32>,
}

/// Splits splats with the same similarity into pieces that move rigidly, and finds the carriers of
/// each.
pub(crate) fn groups(keys: &KeyFrames, dynamic: &[bool], identity: &IdentityMap) -> Groups {
    let mut found = Groups { groups: Vec::new(), of_row: vec![0; identity.rows.len()] };
    let whole = identity.whole_scene();
    let copies = copies(identity, keys.at_edit.len());
    for (number, similarity) in (0..).zip(&identity.similarities) {
        let members: Vec<(usize, u32)> = identity.members(number).collect();
        let mut ids: Vec<u32> = members.iter().map(|member| member.1).collect();
        ids.sort_unstable();
        ids.dedup();
        let first = found.groups.len();
        // A copy is not attached to anything: it moves like the original, under its similarity, as
        // one piece.
        let as_one = copies[number as usize] || whole == Some(number);
        let pieces = if as_one { vec![0; ids.len()] } else { pieces(keys, &ids) };
        for piece in 0..=pieces.iter().copied().max().unwrap_or(0) {
            let of_piece: Vec<u32> = ids
                .iter()
                .zip(&pieces)
                .filter(|(id, of)| **of == piece && !keys.broken[**id as usize])
                .map(|(id, _)| *id)
                .collect();
            let moves = of_piece.iter().filter(|&&id| dynamic[id as usize]).count();
            let follows_carriers = !as_one && 2 * moves > of_piece.len();
            let carriers = if follows_carriers { carriers(keys, &of_piece) } else { Vec::new() };
            found.groups.push(MovedGroup { similarity: *similarity, carriers });
        }
        for (row, id) in members {
            let at = ids.binary_search(&id).map_or(0, |at| pieces[at]);
            found.of_row[row] = index(first + at);
        }
    }
    found
}

/// Flags of the groups that are copies: most of their source splats are also in the edit at their
/// original positions.
pub(crate) fn copies(identity: &IdentityMap, num_sources: usize) -> Vec<bool> {
    let mut in_place = vec![false; num_sources];
    for row in &identity.rows {
        if let Identity::Unchanged(id) | Identity::Recolored(id) = *row {
            in_place[id as usize] = true;
        }
    }
    let mut counts = vec![(0_usize, 0_usize); identity.similarities.len()];
    for row in &identity.rows {
        if let Identity::Moved { source, group } = *row {
            let (members, still_there) = &mut counts[group as usize];
            *members += 1;
            *still_there += usize::from(in_place[source as usize]);
        }
    }
    counts.into_iter().map(|(members, still_there)| 2 * still_there > members).collect()
}

/// Piece of each of `ids`: neighbours belong to one piece if their distance is constant over the
/// times when both are visible.
fn pieces(keys: &KeyFrames, ids: &[u32]) -> Vec<usize> {
    let place = |id: u32| keys.at_edit.means[id as usize].map(f64::from);
    let points: Vec<[f64; 3]> = ids.iter().map(|&id| place(id)).collect();
    let tree = KdTree::<3>::new(&points);
    let slack = OF_SIZE * crate::pose::robust_diameter(&points);
    let mut parent: Vec<usize> = (0..ids.len()).collect();
    let mut near = Vec::new();
    for (i, point) in points.iter().enumerate() {
        tree.nearest(point, NEIGHBORS, &mut near);
        for n in &near {
            let j = n.id as usize;
            if j != i && keep_distance(keys, ids[i] as usize, ids[j] as usize, slack) {
                let (a, b) = (root(&mut parent, i), root(&mut parent, j));
                parent[a.max(b)] = a.min(b);
            }
        }
    }
    let roots: Vec<usize> = (0..ids.len()).map(|i| root(&mut parent, i)).collect();
    let mut sizes = vec![0_usize; ids.len()];
    for &root in &roots {
        sizes[root] += 1;
    }
    let large: Vec<usize> = (0..ids.len()).filter(|&i| sizes[roots[i]] >= MIN_PIECE).collect();
    if large.is_empty() {
        return vec![0; ids.len()];
    }
    let mut number = vec![usize::MAX; ids.len()];
    let mut next = 0;
    for &i in &large {
        if number[roots[i]] == usize::MAX {
            number[roots[i]] = next;
            next += 1;
        }
    }
    let tree = KdTree::<3>::new(&large.iter().map(|&i| points[i]).collect::<Vec<_>>());
    let mut of = |i: usize| {
        if number[roots[i]] != usize::MAX {
            return number[roots[i]];
        }
        tree.nearest(&points[i], 1, &mut near);
        number[roots[large[near[0].id as usize]]]
    };
    (0..ids.len()).map(&mut of).collect()
}

fn root(parent: &mut [usize], mut i: usize) -> usize {
    while parent[i] != i {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    i
}

fn keep_distance(keys: &KeyFrames, i: usize, j: usize, slack: f64) -> bool {
    let apart = |a: [f32; 3], b: [f32; 3]| norm(sub(a.map(f64::from), b.map(f64::from)));
    let before = apart(keys.at_edit.means[i], keys.at_edit.means[j]);
    let limit = slack.max(OF_DISTANCE * before);
    keys.means.iter().enumerate().all(|(k, means)| {
        let both = keys.seen(k, i).min(keys.seen(k, j));
        let change = (apart(means[i], means[j]) - before).abs() * both;
        // False for NaN.
        change <= limit
    })
}

/// Carriers of a piece, with weights. Source splats that deviate from the common motion have lower
/// weights or are left out.
fn carriers(keys: &KeyFrames, ids: &[u32]) -> Vec<(u32, f32)> {
    let step = ids.len().div_ceil(MAX_CARRIERS).max(1);
    let mut order: Vec<u32> = ids.to_vec();
    let x = |id: u32| keys.at_edit.means[id as usize];
    order.sort_by(|&a, &b| {
        let by = |k: usize| x(a)[k].total_cmp(&x(b)[k]);
        by(0).then_with(|| by(1)).then_with(|| by(2)).then(a.cmp(&b))
    });
    let chosen: Vec<u32> = order.into_iter().step_by(step).collect();
    let base: Vec<f64> = chosen
        .iter()
        .map(|&id| (f64::from(keys.at_edit.opacity(id as usize))).max(FADED))
        .collect();
    let mut weights = base.clone();
    for _ in 0..ROUNDS {
        let residuals = residuals(keys, &chosen, &weights);
        // Three times the median deviation: about two standard deviations.
        let typical = gs_core::median(&mut residuals.clone()).unwrap_or(0.0);
        let scale = (3.0 * typical).max(f64::MIN_POSITIVE);
        for ((weight, base), residual) in weights.iter_mut().zip(&base).zip(&residuals) {
            *weight = base * (-0.5 * (residual / scale).powi(2)).exp();
        }
    }
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let kept = chosen.iter().zip(&weights).filter(|(_, weight)| **weight > 1e-3 * largest);
    kept.map(|(&id, &weight)| (id, (weight / largest).as_f32())).collect()
}

/// Largest deviation of each splat from the common rigid motion over the key times, multiplied by
/// its visibility.
fn residuals(keys: &KeyFrames, ids: &[u32], weights: &[f64]) -> Vec<f64> {
    let mut worst = vec![0.0_f64; ids.len()];
    for (k, means) in keys.means.iter().enumerate() {
        let pair = |(&id, &weight): (&u32, &f64)| {
            let id = id as usize;
            let seen = weight * (keys.seen(k, id) + FADED);
            (seen, keys.at_edit.means[id].map(f64::from), means[id].map(f64::from))
        };
        let pairs = ids.iter().zip(weights).map(pair);
        let fit = RigidFit::of(pairs);
        let rotation = fit.rotation(0.0);
        for (worst, &id) in worst.iter_mut().zip(ids) {
            let id = id as usize;
            let expected = fit.apply(rotation, keys.at_edit.means[id].map(f64::from));
            let miss = norm(sub(means[id].map(f64::from), expected)) * keys.seen(k, id);
            *worst = worst.max(miss);
        }
    }
    worst
}
