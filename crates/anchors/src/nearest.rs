//! All-points nearest neighbours of a ranked cloud, in near-linear time even with coincident
//! points.

use crate::AnchorError;
use crate::kdtree::KdTree;
use crate::median::median;
use crate::points::{Coordinate, distance_squared, id_from_rank, widen};

/// The `k` nearest others of every point, `[N,k]`, ties to the lowest rank.
///
/// `ranked` is in lexicographic order, so coincident points are neighbours in it. At most `k + 1`
/// points of a run of coincident points can be among the nearest of any point; only those enter the
/// tree, which avoids a cost of N² for clouds with long runs.
pub(crate) fn all_nearest<const D: usize>(ranked: &[[f64; D]], k: usize) -> Vec<u32> {
    let k = k.min(ranked.len().saturating_sub(1));
    if k == 0 {
        return Vec::new();
    }
    let mut kept_ranks = Vec::with_capacity(ranked.len());
    let mut kept = Vec::with_capacity(ranked.len());
    let mut full_runs = Vec::new();
    for_each_run(ranked, |from, to| {
        for rank in from..to.min(from + k + 1) {
            kept_ranks.push(rank as u32);
            kept.push(ranked[rank]);
        }
        if to - from > k {
            full_runs.push((from, to));
        }
    });
    let tree = KdTree::new(&kept);
    let all_kept = kept.len() == ranked.len();
    if k == 2 && all_kept && full_runs.is_empty() {
        // Fast path for triples of distinct points, without the indirections below.
        let pairs = tree.map_nearest(2, |found| [found[0].id, found[1].id]);
        return pairs.into_flattened();
    }
    let lists = tree.map_nearest(k, |found| {
        found.iter().map(|n| kept_ranks[n.id as usize]).collect::<Vec<u32>>()
    });
    let mut nearest = vec![0; ranked.len() * k];
    for (rank, list) in kept_ranks.iter().zip(lists) {
        let rank = *rank as usize;
        nearest[rank * k..(rank + 1) * k].copy_from_slice(&list);
    }
    for (from, to) in full_runs {
        for rank in from..to {
            let others = (from..to).filter(|other| *other != rank).take(k);
            for (slot, other) in others.enumerate() {
                nearest[rank * k + slot] = other as u32;
            }
        }
    }
    nearest
}

/// Calls `each(from, to)` for every maximal run of equal rows.
pub(crate) fn for_each_run<const D: usize>(
    ranked: &[[f64; D]],
    mut each: impl FnMut(usize, usize),
) {
    let mut from = 0;
    for to in 1..=ranked.len() {
        if to == ranked.len() || ranked[to] != ranked[from] {
            each(from, to);
            from = to;
        }
    }
}

/// Typical spacing `h` of a cloud, world units: the median over its points of the distance to the
/// third nearest other point (to the farthest, if there are fewer than three others).
///
/// 0 for a single point, and if most points coincide with three others.
///
/// # Errors
/// Empty cloud; a coordinate that is not finite or beyond ±1e50.
pub fn median_spacing<T: Coordinate>(points: &[[T; 3]]) -> Result<f64, AnchorError> {
    let points = widen(points)?;
    let ranked: Vec<[f64; 3]> =
        id_from_rank(&points).into_iter().map(|id| points[id as usize]).collect();
    Ok(median_spacing_of_ranked(&ranked))
}

pub(crate) fn median_spacing_of_ranked(ranked: &[[f64; 3]]) -> f64 {
    let k = 3.min(ranked.len() - 1);
    if k == 0 {
        return 0.0;
    }
    let nearest = all_nearest(ranked, k);
    let farthest2 = |rank: usize| {
        let squares = nearest[rank * k..(rank + 1) * k]
            .iter()
            .map(|other| distance_squared(&ranked[rank], &ranked[*other as usize]));
        squares.fold(0.0, f64::max)
    };
    let mut farthest: Vec<f64> = (0..ranked.len()).map(|rank| farthest2(rank).sqrt()).collect();
    median(&mut farthest)
}
