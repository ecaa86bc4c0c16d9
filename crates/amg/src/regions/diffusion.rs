//! Sums spread over regions that move as one: what is learned varies slowly over a body part and
//! not at all across its border.

use super::region_motion::RegionMotion;
use anchors::RigidNeighbors;
use rayon::prelude::*;

/// Neighbours spread to; they move as one with a region at least this much.
const NEIGHBORS: usize = 16;
const MIN_AGREEMENT: f64 = 0.05;

/// Weighted links between regions.
#[derive(Debug)]
pub(super) struct Diffusion {
    links: Vec<Vec<(u32, f64)>>,
}

impl Diffusion {
    pub(super) fn of(neighbors: &RigidNeighbors, motion: &RegionMotion) -> Self {
        let links = (0..motion.outlier.len())
            .map(|i| {
                if motion.outlier[i] {
                    return Vec::new();
                }
                neighbors
                    .get(i)
                    .take(NEIGHBORS)
                    .filter(|(n, agree)| !motion.outlier[n.id as usize] && *agree > MIN_AGREEMENT)
                    .map(|(n, agree)| (n.id, agree))
                    .collect()
            })
            .collect();
        Self { links }
    }

    /// `values` `[R]` after `steps` steps, each of which gives every region the weighted mean of
    /// its own and its neighbours'.
    pub(super) fn spread<const N: usize>(
        &self,
        mut values: Vec<[f64; N]>,
        steps: usize,
    ) -> Vec<[f64; N]> {
        for _ in 0..steps {
            values = (0..values.len())
                .into_par_iter()
                .with_min_len(512)
                .map(|i| {
                    let (mut sum, mut total) = (values[i], 1.0);
                    for &(j, weight) in &self.links[i] {
                        for (sum, value) in sum.iter_mut().zip(values[j as usize]) {
                            *sum += weight * value;
                        }
                        total += weight;
                    }
                    sum.map(|v| v / total)
                })
                .collect();
        }
        values
    }
}
