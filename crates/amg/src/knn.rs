//! Baseline "KNN-Guide": average over the nearest source splats, from any body part.

use crate::options::KnnParams;
use crate::row_index::index;
use anchors::KdTree;
use gs_core::{Real, Splats};

/// For each row of `rows`, the `k` nearest sources of `pool` with weights `1/(d + 1e-8)`.
pub(crate) fn bind(
    source: &Splats,
    pool: &[usize],
    edited: &Splats,
    rows: &[usize],
    params: KnnParams,
) -> Vec<Vec<(u32, f32)>> {
    let points: Vec<[f64; 3]> = pool.iter().map(|&i| source.means[i].map(f64::from)).collect();
    let tree = KdTree::<3>::new(&points);
    let places: Vec<[f64; 3]> = rows.iter().map(|&row| edited.means[row].map(f64::from)).collect();
    tree.map(&places, params.k, |_, near| {
        near.iter()
            .map(|neighbor| {
                let weight = 1.0 / (neighbor.distance_squared.sqrt() + 1e-8);
                (index(pool[neighbor.id as usize]), weight.as_f32())
            })
            .collect()
    })
}
