//! Neighbour graph of the edited splats.

use anchors::Neighbors;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Two neighbouring edited splats, lower first.
pub(super) type Link = (u32, u32);

/// Neighbours per splat.
const NEIGHBORS: usize = 24;

/// Neighbours per splat in edits of more than [`MANY`] splats, to save memory: most splats are
/// matched there, so that paths are short.
const NEIGHBORS_IF_MANY: usize = 12;
const MANY: usize = 10_000;

/// Links longer than this many local spacings are gaps.
const GAP: f64 = 4.0;

/// Sorted links between the edited splats `means` `[N,3]`, and their local spacings, world units,
/// `[N]`.
pub(super) fn links(means: &[[f64; 3]]) -> (Vec<Link>, Vec<f64>) {
    let k = if means.len() > MANY { NEIGHBORS_IF_MANY } else { NEIGHBORS };
    let near = Neighbors::of(means, k);
    let spacing = near.spacing(means.len());
    let mut links: Vec<Link> = Vec::with_capacity(means.len() * k);
    for (i, h) in (0_u32..).zip(&spacing) {
        for n in near.get(i as usize) {
            let h = h.max(spacing[n.id as usize]);
            if n.distance_squared <= (GAP * h).powi(2) {
                links.push((i.min(n.id), i.max(n.id)));
            }
        }
    }
    links.par_sort_unstable();
    links.dedup();
    (links, spacing)
}

/// For every splat, the seed that is nearest along the links (Dijkstra from all seeds at once);
/// `None` where no path leads to one. Ties go to the lower seed.
pub(super) fn nearest_seed(
    means: &[[f64; 3]],
    links: &[Link],
    is_seed: impl Fn(usize) -> bool,
) -> Vec<Option<u32>> {
    let mut owner: Vec<Option<u32>> =
        (0_u32..).take(means.len()).map(|i| is_seed(i as usize).then_some(i)).collect();
    // Most splats are seeds: only links between other splats are stored.
    let mut around: HashMap<u32, Vec<u32>> = HashMap::new();
    let mut heap: BinaryHeap<Reverse<(u64, u32, u32)>> = BinaryHeap::new();
    // Lengths as bits: the order of finite non-negative numbers is that of their bits.
    let reached = |length: u64, from: u32, to: u32| {
        let d = crate::rigid::sub(means[from as usize], means[to as usize]);
        (f64::from_bits(length) + crate::rigid::norm(d)).to_bits()
    };
    for &(a, b) in links {
        for (i, j) in [(a, b), (b, a)] {
            match (owner[i as usize], owner[j as usize]) {
                (Some(seed), None) => heap.push(Reverse((reached(0, i, j), seed, j))),
                (None, None) => around.entry(i).or_default().push(j),
                (_, Some(_)) => {}
            }
        }
    }
    while let Some(Reverse((length, seed, i))) = heap.pop() {
        if owner[i as usize].is_some() {
            continue;
        }
        owner[i as usize] = Some(seed);
        for &j in around.get(&i).into_iter().flatten() {
            if owner[j as usize].is_none() {
                heap.push(Reverse((reached(length, i, j), seed, j)));
            }
        }
    }
    owner
}
