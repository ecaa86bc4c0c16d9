//! [`PointNeighbors`]: nearest neighbours within a point cloud.
//!
//! Uses `kiddo`, not `anchors`: these metrics measure methods that use the search of `anchors`,
//! whose errors must not cancel in the comparison.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Nearest neighbours of each point of a cloud, by Euclidean distance.
#[derive(Debug, Clone, Default)]
pub struct PointNeighbors {
    /// Rows of the neighbours, `[N]` lists of at most the requested number, nearest first, without
    /// the point itself.
    of: Vec<Vec<u32>>,
}

impl PointNeighbors {
    /// The `count` nearest neighbours of each of `points`, `[N]` in any unit. Empty if there are at
    /// most `count` points, or if the points cannot be indexed (not finite).
    pub fn of(points: &[[f32; 3]], count: usize) -> Self {
        let Some(query) = NonZero::new(count + 1).filter(|_| points.len() > count) else {
            return Self::default();
        };
        let Ok(tree) = ImmutableKdTree::<f32, 3>::new_from_slice(points) else {
            return Self::default();
        };
        let of = (0..points.len())
            .into_par_iter()
            .map(|i| {
                let hits =
                    tree.query(&points[i]).nearest_n::<SquaredEuclidean<f32>>(query).execute();
                let others = hits.iter().map(|hit| hit.item).filter(|&j| j as usize != i);
                others.take(count).collect()
            })
            .collect();
        Self { of }
    }

    /// Rows of the neighbours of each point, `[N]`, nearest first; empty if there are none.
    pub fn rows(&self) -> &[Vec<u32>] {
        &self.of
    }
}

/// Row of the nearest of `among` for each of `points`, `[N]`, by Euclidean distance. `None` if
/// `among` is empty or cannot be indexed.
pub fn nearest(points: &[[f32; 3]], among: &[[f32; 3]]) -> Option<Vec<u32>> {
    let tree = ImmutableKdTree::<f32, 3>::new_from_slice(among).ok()?;
    let one = NonZero::new(1).filter(|_| !among.is_empty())?;
    points
        .par_iter()
        .map(|point| {
            let hits = tree.query(point).nearest_n::<SquaredEuclidean<f32>>(one).execute();
            hits.first().map(|hit| hit.item)
        })
        .collect()
}
