//! Diffusion of per-region sums between neighbours that move together: statistics are smooth within
//! a body part and independent across its border.

use super::region_motion::RegionMotion;
use anchors::RigidNeighbors;
use rayon::prelude::*;

/// Nearest neighbours linked to a region.
const NEIGHBORS: usize = 16;

/// Minimum agreement of linked regions: weaker links contribute almost nothing.
const MIN_AGREEMENT: f64 = 0.05;

/// Links between regions, weighted by agreement; outliers have none.
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

    /// `values` `[R]` after `steps` steps. Each step replaces the value of every region by the
    /// weighted mean of its own, with weight 1, and its neighbours'.
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
