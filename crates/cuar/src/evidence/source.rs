//! State of each edited splat before the edit.

use super::before::BeforeEdit;
use anchors::KdTree;
use gs_core::{Splats, rotation_matrix, sh};
use rayon::prelude::*;

/// Source splats compared with an edited one of other geometry.
const CANDIDATES: usize = 24;
/// A splat is new if its distance from every source splat exceeds this many times the size of that
/// source splat.
const REACH: f64 = 6.0;

/// The source splat from which each edited splat descends; `None` for new ones.
pub(super) fn parents(
    before: &BeforeEdit<'_>,
    first: &Splats,
    source: &Splats,
) -> Vec<Option<u32>> {
    if !before.source_rows.contains(&None) {
        return before.source_rows.to_vec();
    }
    let sound: Vec<usize> = (0..source.len()).filter(|&id| source.is_finite(id)).collect();
    let points: Vec<[f64; 3]> = sound.iter().map(|&id| source.means[id].map(f64::from)).collect();
    if points.is_empty() {
        return before.source_rows.to_vec();
    }
    let tree = KdTree::<3>::new(&points);
    let find = |(i, known): (usize, &Option<u32>)| {
        if known.is_some() || !first.is_finite(i) {
            return *known;
        }
        let mut found = Vec::new();
        tree.nearest(&first.means[i].map(f64::from), CANDIDATES, &mut found);
        let unlike = |neighbor: &anchors::Neighbor| {
            let id = sound[neighbor.id as usize];
            // equal bits: a moved copy that kept its colour
            let is_copy = first.sh_of(i) == source.sh_of(id);
            let unlike = unlikeness(first, i, source, id, neighbor.distance_squared);
            if is_copy { 0.0 } else { unlike }
        };
        let best = found.iter().min_by(|a, b| unlike(a).total_cmp(&unlike(b)))?;
        let id = sound[best.id as usize];
        let is_near = best.distance_squared.sqrt() <= REACH * size(source, id);
        is_near.then_some(row_id(id))
    };
    before.source_rows.par_iter().with_min_len(256).enumerate().map(find).collect()
}

/// Largest scale, world units.
pub(super) fn size(splats: &Splats, i: usize) -> f64 {
    splats.scale(i).iter().fold(0.0_f64, |a, &b| a.max(f64::from(b)))
}

/// Axis of the smallest scale.
pub(super) fn thin_axis(splats: &Splats, i: usize) -> [f32; 3] {
    let scale = splats.scale(i);
    let thin = (0..3).min_by(|&a, &b| scale[a].total_cmp(&scale[b])).unwrap_or(0);
    let rotation = rotation_matrix(splats.rotation(i));
    [0, 1, 2].map(|row| rotation[row][thin])
}

/// Dissimilarity of two splats: distance in sizes, scales and thin axis.
fn unlikeness(a: &Splats, i: usize, b: &Splats, id: usize, distance_squared: f64) -> f64 {
    let place = distance_squared / size(b, id).powi(2).max(1e-30);
    let scales: f32 = (0..3).map(|k| (a.log_scales[i][k] - b.log_scales[id][k]).powi(2)).sum();
    let (n, m) = (thin_axis(a, i), thin_axis(b, id));
    let cosine: f32 = (0..3).map(|k| n[k] * m[k]).sum();
    place + f64::from(scales) + 1.0 - f64::from(cosine.powi(2))
}

/// SH before the edit, `[M,K,3]`, of the edited splats' degree; for new splats, their own.
pub(super) fn colors(parents: &[Option<u32>], first: &Splats, source: &Splats) -> Vec<[f32; 3]> {
    let coeffs = first.sh_coeffs();
    let mut old = first.sh.clone();
    for (own, parent) in old.chunks_exact_mut(coeffs).zip(parents) {
        if let Some(id) = parent {
            own.fill([0.0; 3]);
            own.iter_mut().zip(source.sh_of(*id as usize)).for_each(|(own, rgb)| *own = *rgb);
        }
    }
    old
}

/// Change of base colour, summed over the channels, `[M]`; 0 for new splats.
pub(super) fn changes(parents: &[Option<u32>], first: &Splats, old: &[[f32; 3]]) -> Vec<f32> {
    let coeffs = first.sh_coeffs();
    let change = |(i, parent): (usize, &Option<u32>)| {
        let (now, then) = (first.sh_of(i)[0], old[i * coeffs]);
        let sum: f32 = (0..3).map(|c| ((now[c] - then[c]) * sh::C0).abs()).sum();
        if parent.is_some() && sum.is_finite() { sum } else { 0.0 }
    };
    parents.iter().enumerate().map(change).collect()
}

/// Source splats that the edit deleted: no edited splat descends from them, and no new one is at
/// their position.
pub(super) fn gone(
    before: &BeforeEdit<'_>,
    parents: &[Option<u32>],
    first: &Splats,
    source: &Splats,
) -> Vec<u32> {
    let mut used = vec![false; source.len()];
    parents.iter().flatten().for_each(|&id| used[id as usize] = true);
    let gone = (0..source.len()).filter(|&id| !used[id] && source.is_finite(id));
    let gone: Vec<usize> = gone.collect();
    let new: Vec<[f64; 3]> = (0..first.len())
        .filter(|&i| before.source_rows[i].is_none() && first.is_finite(i))
        .map(|i| first.means[i].map(f64::from))
        .collect();
    if gone.is_empty() || new.is_empty() {
        return gone.into_iter().map(row_id).collect();
    }
    let tree = KdTree::<3>::new(&new);
    let mut found = Vec::new();
    let is_empty = |id: &usize| {
        tree.nearest(&source.means[*id].map(f64::from), 1, &mut found);
        let reach = REACH * size(source, *id);
        found.first().is_none_or(|n| n.distance_squared.sqrt() > reach)
    };
    gone.into_iter().filter(is_empty).map(row_id).collect()
}

/// A row number as stored.
#[expect(clippy::cast_possible_truncation, reason = "the rasteriser numbers splats in 32 bits")]
pub(super) fn row_id(i: usize) -> u32 {
    i as u32
}
