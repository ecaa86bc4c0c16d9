//! Reference results that need known parts: the best result with rigid
//! parts, and the result of nearest neighbours.
//!
//! With the k-d tree of `kiddo`: that of `anchors` is part of the methods under test.

use crate::{EditedFrame, Kind, Part, SynthError, SynthScene};
use gs_core::{Splats, quat};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::collections::BTreeMap;
use std::num::NonZero;

/// Source splats per edited splat.
const SOURCES: usize = 16;
/// Number of nearest source splats among which the most similar normal is selected.
const CANDIDATES: usize = 24;
/// Penalty of opposite normals, squared local spacings.
const NORMALS: f32 = 9.0;

/// How the body part that moves an edited splat is determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartBy {
    /// The true part: the best result with rigid parts, up to their soft joints.
    Truth,
    /// The part of the nearest source splat, with different normals counting as distance. Floaters
    /// and outliers are known, so this is better than any method without correspondences.
    Nearness,
}

/// For every edited splat, source splats of one body part around it, and weights that sum to 1.
/// None for splats of parts without valid source splats, such as floaters.
///
/// # Errors
/// If the scene cannot be evaluated.
pub fn part_neighbors(
    source: &SynthScene,
    edited: &EditedFrame,
    by: PartBy,
) -> Result<Vec<Vec<(u32, f32)>>, SynthError> {
    let frame1 = source.frame1();
    let moves_with_part =
        |i: &usize| matches!(source.rows()[*i].kind, Kind::Surface | Kind::Interior);
    let mut parts: BTreeMap<Part, Vec<usize>> = BTreeMap::new();
    for i in (0..frame1.len()).filter(moves_with_part) {
        parts.entry(source.rows()[i].part).or_default().push(i);
    }
    let trees: BTreeMap<Part, Tree> =
        parts.into_iter().map(|(part, ids)| (part, Tree::new(frame1, ids))).collect();
    let all = Tree::new(frame1, (0..frame1.len()).filter(moves_with_part).collect());
    let rows = (0..edited.splats.len()).map(|e| {
        let part = match by {
            PartBy::Truth => Some(edited.truth.parts[e]),
            PartBy::Nearness => nearest_similar_part(source, &all, &edited.splats, e),
        };
        let tree = part.and_then(|part| trees.get(&part));
        tree.map_or_else(Vec::new, |tree| blend(&tree.nearest(edited.splats.means[e], SOURCES)))
    });
    Ok(rows.collect())
}

/// Part of the nearest source splat, with different normals counting as distance.
fn nearest_similar_part(
    source: &SynthScene,
    all: &Tree,
    edited: &Splats,
    e: usize,
) -> Option<Part> {
    nearest_similar(source.frame1(), all, edited, e).map(|row| source.rows()[row].part)
}

/// The nearest source splat, with different normals counting as distance.
pub(crate) fn nearest_similar(
    source: &Splats,
    all: &Tree,
    edited: &Splats,
    e: usize,
) -> Option<usize> {
    let near = all.nearest(edited.means[e], CANDIDATES);
    let spacing = near.get(6).or(near.last())?.1;
    let normal = thin_axis(edited, e);
    let cost = |&(id, squared): &(usize, f32)| {
        let other = thin_axis(source, id);
        let cosine = (0..3).map(|a| normal[a] * other[a]).sum::<f32>();
        squared + NORMALS * spacing * (1.0 - cosine * cosine)
    };
    near.iter().min_by(|a, b| cost(a).total_cmp(&cost(b))).map(|best| best.0)
}

pub(crate) fn thin_axis(splats: &Splats, i: usize) -> [f32; 3] {
    let scale = splats.log_scales[i];
    let thin = (0..3).fold(0, |best, axis| if scale[axis] < scale[best] { axis } else { best });
    let mut axis = [0.0; 3];
    axis[thin] = 1.0;
    quat::rotate(quat::normalize(splats.quats[i]), axis)
}

/// Gaussian weights around the nearest; their width grows with its distance.
fn blend(near: &[(usize, f32)]) -> Vec<(u32, f32)> {
    let Some(&(_, nearest)) = near.first() else { return Vec::new() };
    let width = (0.5 * near[near.len().min(7) - 1].1 + 0.09 * nearest).max(f32::MIN_POSITIVE);
    let weights: Vec<f32> =
        near.iter().map(|(_, squared)| (-0.5 * (squared - nearest) / width).exp()).collect();
    let total: f32 = weights.iter().sum();
    near.iter()
        .zip(weights)
        .map(|(&(id, _), weight)| (crate::math::row_id(id), weight / total))
        .collect()
}

/// Source splats in a spatial index.
pub(crate) struct Tree {
    ids: Vec<usize>,
    tree: Option<ImmutableKdTree<f32, 3>>,
}

impl Tree {
    pub(crate) fn new(splats: &Splats, ids: Vec<usize>) -> Self {
        let points: Vec<[f32; 3]> = ids.iter().map(|&i| splats.means[i]).collect();
        Self { tree: ImmutableKdTree::new_from_slice(&points).ok(), ids }
    }

    /// Rows and squared distances, nearest first.
    pub(crate) fn nearest(&self, x: [f32; 3], count: usize) -> Vec<(usize, f32)> {
        let count = NonZero::new(count.min(self.ids.len()));
        let (Some(tree), Some(count)) = (&self.tree, count) else { return Vec::new() };
        let hits = tree.query(&x).nearest_n::<SquaredEuclidean<f32>>(count).execute();
        hits.iter().map(|hit| (self.ids[hit.item as usize], hit.distance)).collect()
    }
}
