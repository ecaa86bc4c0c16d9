//! Nearest regions of a point.

use super::region_motion::RegionMotion;
use super::source::Regions;
use crate::row_index::index;
use anchors::{KdTree, Neighbor};

/// Search tree over the centroids of the regions that are not outliers.
pub(super) struct RegionTree {
    tree: KdTree<3>,
    /// Region of each point of the tree.
    regions: Vec<u32>,
}

impl RegionTree {
    pub(super) fn new(regions: &Regions, motion: &RegionMotion) -> Self {
        let ids: Vec<usize> = (0..regions.len()).filter(|&i| !motion.outlier[i]).collect();
        let points: Vec<[f64; 3]> = ids.iter().map(|&i| regions.centroids.rest[i]).collect();
        Self { tree: KdTree::new(&points), regions: ids.into_iter().map(index).collect() }
    }

    /// The `k` nearest regions, as [`KdTree::nearest`] finds them; ids are those of the regions.
    pub(super) fn nearest(&self, x: &[f64; 3], k: usize, out: &mut Vec<Neighbor>) {
        self.tree.nearest(x, k, out);
        for neighbor in out {
            neighbor.id = self.regions[neighbor.id as usize];
        }
    }
}
