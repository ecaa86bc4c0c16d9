//! Grouping of ranked points into sets of equal size.
//!
//! Rows are in lexicographic order and identified by rank, so that no result depends on the order
//! of the input. Sets are flat, `size` ascending ranks each, in lexicographic order.

use rayon::prelude::*;

use crate::median::median;
use crate::nearest::{all_nearest, for_each_run};
use crate::points::distance_squared;

/// Maximum number of rounds of proposals; only artificial clouds need more than a few.
const MAX_ROUNDS: usize = 64;

/// Partition by a greedy algorithm that does not depend on the order of the input; see
/// [`Neighborhoods::build`](crate::Neighborhoods::build).
pub(crate) fn disjoint<const D: usize>(
    ranked: &[[f64; D]],
    size: usize,
    max_edge_ratio: f64,
) -> Vec<u32> {
    if size == 1 {
        return (0..ranked.len() as u32).collect();
    }
    let (mut accepted, mut free) = coincident(ranked, size);
    let mut max_edge = f64::INFINITY;
    for round in 0..MAX_ROUNDS {
        if free.len() < size {
            break;
        }
        let proposals = Proposals::new(ranked, &free, size);
        if round == 0 {
            max_edge = max_edge_ratio * proposals.median_edge();
        }
        let mut taken = vec![false; free.len()];
        let before = accepted.len();
        for (edge, proposer) in proposals.by_edge() {
            if edge > max_edge {
                break;
            }
            let set = proposals.get(proposer);
            if set.iter().any(|member| taken[*member as usize]) {
                continue;
            }
            for member in set {
                taken[*member as usize] = true;
                accepted.push(free[*member as usize]);
            }
        }
        if accepted.len() == before {
            break;
        }
        free = free.iter().zip(&taken).filter(|(_, t)| !**t).map(|(rank, _)| *rank).collect();
    }
    in_order(&accepted, size)
}

/// One set per point, itself and its nearest others; equal sets once.
pub(crate) fn overlapping<const D: usize>(ranked: &[[f64; D]], size: usize) -> Vec<u32> {
    let sets = with_nearest(ranked, size);
    let mut sets = in_order(&sets, size);
    let mut kept = size.min(sets.len());
    for from in (size..sets.len()).step_by(size) {
        if sets[from..from + size] != sets[kept - size..kept] {
            sets.copy_within(from..from + size, kept);
            kept += size;
        }
    }
    sets.truncate(kept);
    sets
}

/// Sets of coincident points, and the ranks that remain. They have edge 0, so the greedy algorithm
/// would accept them first, but only one set of a run per round, because all its points propose the
/// same set.
fn coincident<const D: usize>(ranked: &[[f64; D]], size: usize) -> (Vec<u32>, Vec<u32>) {
    let (mut accepted, mut free) = (Vec::new(), Vec::new());
    for_each_run(ranked, |from, to| {
        let split = to - (to - from) % size;
        accepted.extend(from as u32..split as u32);
        free.extend(split as u32..to as u32);
    });
    (accepted, free)
}

/// Every row with its `size - 1` nearest others, ascending.
fn with_nearest<const D: usize>(rows: &[[f64; D]], size: usize) -> Vec<u32> {
    let nearest = all_nearest(rows, size - 1);
    let mut sets = vec![0; rows.len() * size];
    sets.par_chunks_mut(size).enumerate().with_min_len(1024).for_each(|(row, set)| {
        set[0] = row as u32;
        set[1..].copy_from_slice(&nearest[row * (size - 1)..(row + 1) * (size - 1)]);
        set.sort_unstable();
    });
    sets
}

/// Proposals of the free points in one round. Members are positions in the list of free points.
struct Proposals {
    sets: Vec<u32>,
    edges: Vec<f64>,
    size: usize,
}

impl Proposals {
    fn new<const D: usize>(ranked: &[[f64; D]], free: &[u32], size: usize) -> Self {
        let rows: Vec<[f64; D]> = free.iter().map(|rank| ranked[*rank as usize]).collect();
        let sets = with_nearest(&rows, size);
        let edges = sets.par_chunks(size).with_min_len(1024).map(|set| mean_edge(&rows, set));
        Self { edges: edges.collect(), sets, size }
    }

    fn get(&self, proposer: u32) -> &[u32] {
        &self.sets[proposer as usize * self.size..][..self.size]
    }

    /// Median mean edge of the proposals with positive extent.
    fn median_edge(&self) -> f64 {
        let positive = self.edges.iter().copied().filter(|edge| *edge > 0.0);
        median(&mut positive.collect::<Vec<f64>>())
    }

    /// (mean edge, proposer), ascending by edge, then by members.
    fn by_edge(&self) -> Vec<(f64, u32)> {
        let mut order: Vec<(f64, u32)> = self.edges.iter().copied().zip(0..).collect();
        order.par_sort_unstable_by(|a, b| {
            a.0.total_cmp(&b.0).then_with(|| self.get(a.1).cmp(self.get(b.1))).then(a.1.cmp(&b.1))
        });
        order
    }
}

/// Mean distance over all pairs of a set; 0 for a single member.
pub(crate) fn mean_edge<const D: usize>(rows: &[[f64; D]], set: &[u32]) -> f64 {
    let mut sum = 0.0;
    for (i, a) in set.iter().enumerate() {
        for b in &set[i + 1..] {
            sum += distance_squared(&rows[*a as usize], &rows[*b as usize]).sqrt();
        }
    }
    sum / (set.len() * (set.len() - 1) / 2).max(1) as f64
}

/// Sorts sets lexicographically.
fn in_order(sets: &[u32], size: usize) -> Vec<u32> {
    let mut order: Vec<(u32, u32)> = sets.chunks(size).map(|set| set[0]).zip(0..).collect();
    let get = |i: u32| &sets[i as usize * size..][..size];
    order.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| get(a.1).cmp(get(b.1))));
    order.iter().flat_map(|(_, i)| get(*i)).copied().collect()
}
