//! Refinement of rest places over whole lives.
//!
//! A match determines the rest place of a splat from a single moment of its life. Its neighbours at
//! rest give an estimate at every other moment as well; the mean of the estimates reduces the
//! errors that accumulate along chains.

use super::lives::Lives;
use super::rest::Rest;
use crate::rigid::RigidFit;
use anchors::KdTree;
use rayon::prelude::*;

/// Passes over all splats; information spreads by one generation per pass.
const ROUNDS: usize = 4;
/// Moments of a life that are used.
const MOMENTS: usize = 5;
/// Number of nearest neighbours at rest that are used, among those visible at that moment.
const NEIGHBORS: usize = 16;
/// Weight of the position at the edit time at full presence, in moments of a life.
const SHOWN: f64 = 4.0;

/// Refines the rest places. For splats that are visible in the edit frame, the position there
/// counts with their presence.
pub(super) fn polish(lives: &Lives, rest: &mut [Option<Rest>]) {
    let moments: Vec<Vec<usize>> = (0..lives.len()).map(|i| moments(lives, i)).collect();
    for _ in 0..ROUNDS {
        let mut sums: Vec<([f64; 3], f64)> = (0..rest.len())
            .map(|i| {
                let weight = SHOWN * lives.presence(lives.edit, i).powi(2);
                (lives.place(lives.edit, i).map(|v| weight * v), weight)
            })
            .collect();
        for k in 0..lives.times.len() {
            let asking: Vec<usize> =
                (0..rest.len()).filter(|&i| rest[i].is_some() && moments[i].contains(&k)).collect();
            if asking.is_empty() {
                continue;
            }
            let there: Vec<usize> =
                (0..rest.len()).filter(|&i| rest[i].is_some() && lives.is_visible(k, i)).collect();
            let place = |&i: &usize| rest[i].map_or([0.0; 3], |rest| rest.place);
            let places: Vec<[f64; 3]> = there.iter().map(place).collect();
            let tree = KdTree::<3>::new(&places);
            let queries: Vec<[f64; 3]> = asking.iter().map(place).collect();
            let said = tree.map(&queries, NEIGHBORS + 1, |at, near| {
                let own = asking[at];
                let spread = near.last().map_or(0.0, |n| n.distance_squared).max(1e-300);
                let pairs = near.iter().filter_map(|n| {
                    let i = there[n.id as usize];
                    let present = lives.presence(k, i);
                    let weight = (-2.0 * n.distance_squared / spread).exp() * present * present;
                    (i != own).then(|| (weight + 1e-9, lives.place(k, i), places[n.id as usize]))
                });
                let fit = RigidFit::of(pairs.collect::<Vec<_>>().into_iter());
                fit.apply(fit.rotation(0.0), lives.place(k, own))
            });
            for (&i, said) in asking.iter().zip(said) {
                let weight = lives.presence(k, i).powi(2) + 1e-6;
                if said.iter().all(|value| value.is_finite()) {
                    for axis in 0..3 {
                        sums[i].0[axis] += weight * said[axis];
                    }
                    sums[i].1 += weight;
                }
            }
        }
        rest.par_iter_mut().zip(&sums).for_each(|(rest, (sum, weight))| {
            if let Some(rest) = rest.as_mut().filter(|_| *weight > 0.0) {
                rest.place = sum.map(|v| v / weight);
            }
        });
    }
}

/// At most [`MOMENTS`] key times at which splat `i` is visible, evenly spaced.
fn moments(lives: &Lives, i: usize) -> Vec<usize> {
    let there: Vec<usize> = (0..lives.times.len()).filter(|&k| lives.is_visible(k, i)).collect();
    let count = there.len().min(MOMENTS);
    (0..count).map(|m| there[(2 * m + 1) * there.len() / (2 * count)]).collect()
}
