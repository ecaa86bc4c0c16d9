//! Neighbour graph of the edited splats.

use crate::row_index::index;
use anchors::Neighbors;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Number of neighbours per splat.
const NEIGHBORS: usize = 24;

/// Number of neighbours per splat in edits of more than [`MANY`] splats. It saves memory; fewer
/// suffice, because most splats are matched in large edits and paths are short.
const NEIGHBORS_IF_MANY: usize = 12;
const MANY: usize = 10_000;

/// Links longer than this many local spacings are gaps.
const GAP: f64 = 4.0;

/// Two linked splats, and their distance in world units.
pub(super) type Link = (u32, u32, f64);

/// Links between neighbouring edited splats.
#[derive(Debug)]
pub(super) struct Graph {
    near: Neighbors,
    /// Local spacing of each splat, world units, `[N]`.
    pub(super) spacing: Vec<f64>,
}

impl Graph {
    /// The graph of the edited splats `means` `[N,3]`.
    pub(super) fn of(means: &[[f64; 3]]) -> Self {
        let k = if means.len() > MANY { NEIGHBORS_IF_MANY } else { NEIGHBORS };
        let near = Neighbors::of(means, k);
        let spacing = near.spacing();
        Self { near, spacing }
    }

    /// The links between two splats that are `wanted`. Links between mutual nearest neighbours are
    /// returned twice.
    pub(super) fn links(
        &self,
        wanted: impl Fn(usize, usize) -> bool + Copy,
    ) -> impl Iterator<Item = Link> {
        (0..self.spacing.len()).flat_map(move |i| {
            self.near.get(i).filter_map(move |n| {
                let (j, length) = (n.id as usize, n.distance_squared.sqrt());
                let h = self.spacing[i].max(self.spacing[j]);
                (wanted(i, j) && length <= GAP * h).then_some((index(i), n.id, length))
            })
        })
    }
}

/// For every splat, the seed that is nearest along the links (Dijkstra from all seeds at once);
/// `None` if there is no path to a seed. Ties go to the lower seed.
pub(super) fn nearest_seed(
    graph: &Graph,
    is_seed: impl Fn(usize) -> bool + Sync,
) -> Vec<Option<u32>> {
    let num_splats = graph.spacing.len();
    let mut owner: Vec<Option<u32>> =
        (0_u32..).take(num_splats).map(|i| is_seed(i as usize).then_some(i)).collect();
    let mut around: HashMap<u32, Vec<(u32, f64)>> = HashMap::new();
    // Lengths as bits, which have the same order for finite non-negative numbers.
    let mut heap: BinaryHeap<Reverse<(u64, u32, u32)>> = BinaryHeap::new();
    // Most splats are seeds; few links have an end that is not a seed.
    for (a, b, length) in graph.links(&|i, j| !(is_seed(i) && is_seed(j))) {
        for (i, j) in [(a, b), (b, a)] {
            match (owner[i as usize], owner[j as usize]) {
                (Some(seed), None) => heap.push(Reverse((length.to_bits(), seed, j))),
                (None, None) => around.entry(i).or_default().push((j, length)),
                (_, Some(_)) => {}
            }
        }
    }
    while let Some(Reverse((length, seed, i))) = heap.pop() {
        if owner[i as usize].is_some() {
            continue;
        }
        owner[i as usize] = Some(seed);
        for &(j, step) in around.get(&i).into_iter().flatten() {
            if owner[j as usize].is_none() {
                heap.push(Reverse(((f64::from_bits(length) + step).to_bits(), seed, j)));
            }
        }
    }
    owner
}
