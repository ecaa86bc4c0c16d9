//! [`extend_labels`]: extends labels of supervised splats over the surface.

use super::surface::SurfaceGraph;
use rayon::prelude::*;

/// Number of rounds. A label spreads by one neighbour per round; hidden regions are a few tens of
/// splats wide at most.
const ROUNDS: usize = 100;
/// Weight of a node's own label, relative to that of all its neighbours.
const OWN_WEIGHT: f32 = 10.0;
/// Neighbours with a smaller weight belong to a different surface.
const FAINT: f32 = 0.02;

/// For every node of `surface`, two shares in 0 to 1: a mean of its own `label`, weighted by
/// `known` (0 to 1), and of its neighbours' shares (the harmonic function with the known nodes as
/// boundary); `None` for nodes that are not connected to a known one.
pub(super) fn extend_labels(
    surface: &SurfaceGraph,
    label: &(impl Fn(usize) -> [f32; 2] + Sync),
    known: &(impl Fn(usize) -> f32 + Sync),
) -> Vec<Option<[f32; 2]>> {
    // shares, and 1 if a label has reached the node, else 0
    let mut now: Vec<([f32; 2], f32)> = (0..surface.len())
        .map(|i| if known(i) > 0.0 { (label(i), 1.0) } else { ([0.0; 2], 0.0) })
        .collect();
    let open: Vec<usize> = (0..surface.len()).filter(|&i| known(i) < 1.0).collect();
    for _ in 0..ROUNDS {
        let next: Vec<([f32; 2], f32)> = open
            .par_iter()
            .with_min_len(512)
            .map(|&i| {
                let (mut sums, mut total, mut all) = ([0.0_f32; 2], 0.0_f32, 0.0_f32);
                for (j, weight) in surface.of_node(i).filter(|(_, weight)| *weight > FAINT) {
                    all += weight;
                    let weight = weight * now[j].1;
                    total += weight;
                    sums[0] += weight * now[j].0[0];
                    sums[1] += weight * now[j].0[1];
                }
                let own = OWN_WEIGHT * known(i) * all;
                if total + own <= 0.0 {
                    return now[i];
                }
                let known_label = label(i);
                ([0, 1].map(|k| (sums[k] + own * known_label[k]) / (total + own)), 1.0)
            })
            .collect();
        open.iter().zip(next).for_each(|(&i, next)| now[i] = next);
    }
    now.into_iter().map(|(shares, arrived)| (arrived > 0.0).then_some(shares)).collect()
}
