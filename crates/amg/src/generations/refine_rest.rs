//! Refinement of rest positions over whole lifetimes.
//!
//! A match determines the rest position of a splat at a single time. Its neighbours in rest
//! positions give an estimate at every other time of its lifetime; averaging the estimates reduces
//! the errors that accumulate along chains.

use super::lifetimes::Lifetimes;
use super::rest::Rest;
use crate::rigid::RigidFit;
use anchors::KdTree;
use rayon::prelude::*;

/// Passes over all splats; information propagates by one generation per pass.
const ROUNDS: usize = 4;
/// Number of times per lifetime that are used.
const MOMENTS: usize = 5;
/// Number of nearest neighbours in rest positions that are used, among those visible at that time.
const NEIGHBORS: usize = 16;
/// Weight of the position at the edit time, relative to one estimate, for a presence of 1.
const EDIT_TIME_WEIGHT: f64 = 4.0;

/// Refines the rest positions. For splats that are visible in the edit frame, the weight of the
/// position there is their squared presence.
pub(super) fn refine_rest(lifetimes: &Lifetimes, rest: &mut [Option<Rest>]) {
    let moments: Vec<Vec<usize>> = (0..lifetimes.len()).map(|i| moments(lifetimes, i)).collect();
    for _ in 0..ROUNDS {
        let mut sums: Vec<([f64; 3], f64)> = (0..rest.len())
            .map(|i| {
                let weight = EDIT_TIME_WEIGHT * lifetimes.presence(lifetimes.edit, i).powi(2);
                (lifetimes.position(lifetimes.edit, i).map(|v| weight * v), weight)
            })
            .collect();
        for k in 0..lifetimes.times.len() {
            let present: Vec<usize> =
                (0..rest.len()).filter(|&i| rest[i].is_some() && moments[i].contains(&k)).collect();
            if present.is_empty() {
                continue;
            }
            let there: Vec<usize> = (0..rest.len())
                .filter(|&i| rest[i].is_some() && lifetimes.is_visible(k, i))
                .collect();
            let position = |&i: &usize| rest[i].map_or([0.0; 3], |rest| rest.position);
            let positions: Vec<[f64; 3]> = there.iter().map(position).collect();
            let tree = KdTree::<3>::new(&positions);
            let queries: Vec<[f64; 3]> = present.iter().map(position).collect();
            let estimates = tree.map(&queries, NEIGHBORS + 1, |at, near| {
                let own = present[at];
                let spread = near.last().map_or(0.0, |n| n.distance_squared).max(1e-300);
                let pairs = near.iter().filter_map(|n| {
                    let i = there[n.id as usize];
                    let presence = lifetimes.presence(k, i);
                    let weight = (-2.0 * n.distance_squared / spread).exp() * presence * presence;
                    (i != own).then(|| {
                        (weight + 1e-9, lifetimes.position(k, i), positions[n.id as usize])
                    })
                });
                let fit = RigidFit::of(pairs.collect::<Vec<_>>().into_iter());
                fit.apply(fit.rotation(0.0), lifetimes.position(k, own))
            });
            for (&i, estimate) in present.iter().zip(estimates) {
                let weight = lifetimes.presence(k, i).powi(2) + 1e-6;
                if estimate.iter().all(|value| value.is_finite()) {
                    for axis in 0..3 {
                        sums[i].0[axis] += weight * estimate[axis];
                    }
                    sums[i].1 += weight;
                }
            }
        }
        rest.par_iter_mut().zip(&sums).for_each(|(rest, (sum, weight))| {
            if let Some(rest) = rest.as_mut().filter(|_| *weight > 0.0) {
                rest.position = sum.map(|v| v / weight);
            }
        });
    }
}

/// At most [`MOMENTS`] key times at which splat `i` is visible, evenly spaced.
fn moments(lifetimes: &Lifetimes, i: usize) -> Vec<usize> {
    let there: Vec<usize> =
        (0..lifetimes.times.len()).filter(|&k| lifetimes.is_visible(k, i)).collect();
    let count = there.len().min(MOMENTS);
    (0..count).map(|m| there[(2 * m + 1) * there.len() / (2 * count)]).collect()
}
