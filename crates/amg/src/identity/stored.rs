//! Rows that differ from source splats only by the rounding of a file format.

use super::row::Identity;
use crate::row_index::index;
use anchors::{KdTree, Neighbor};
use gs_core::{Precision, RowPrecision, Splats, quat};
use rayon::prelude::*;

/// Number of source splats compared first; it is increased while all of them are within the
/// precision.
const CANDIDATES: usize = 8;
/// Maximum number of source splats compared: with coarse positions, many splats of a small scene
/// coincide.
const MAX_CANDIDATES: usize = 512;
/// Rounding of arithmetic when the file is written and read, relative to the values.
const ROUNDING: f64 = 1e-6;

/// Fills the entries of `rows` that are source splats within the precision of the file.
pub(super) fn matches(
    source: &Splats,
    edited: &Splats,
    precision: &Precision,
    rows: &mut [Identity],
) {
    let ids: Vec<u32> = (0..source.len()).filter(|&i| source.is_finite(i)).map(index).collect();
    if ids.is_empty() {
        return;
    }
    let points: Vec<[f64; 3]> =
        ids.iter().map(|&id| source.means[id as usize].map(f64::from)).collect();
    let tree = KdTree::<3>::new(&points);
    rows.par_iter_mut().enumerate().with_min_len(256).for_each_init(
        Vec::new,
        |near, (row, slot)| {
            if *slot == Identity::Edited && edited.is_finite(row) {
                let pair = StoredPair { source, edited, row, precision: precision.of(row) };
                *slot = pair.nearest(&tree, &ids, near);
            }
        },
    );
}

struct StoredPair<'a> {
    source: &'a Splats,
    edited: &'a Splats,
    row: usize,
    precision: &'a RowPrecision,
}

impl StoredPair<'_> {
    fn nearest(&self, tree: &KdTree<3>, ids: &[u32], near: &mut Vec<Neighbor>) -> Identity {
        let mean = self.edited.means[self.row].map(f64::from);
        let radius_squared: f64 = (0..3).map(|k| self.mean_limit(k).powi(2)).sum();
        let mut wanted = CANDIDATES;
        loop {
            tree.nearest(&mean, wanted, near);
            let exhausted = near.len() < wanted || wanted >= MAX_CANDIDATES;
            let beyond = near.last().is_none_or(|last| last.distance_squared > radius_squared);
            if exhausted || beyond {
                return self.best(near, ids);
            }
            wanted *= 4;
        }
    }

    /// The candidate with the smallest deviation among those that agree in all values; if there are
    /// none, among those that agree in geometry.
    fn best(&self, near: &[Neighbor], ids: &[u32]) -> Identity {
        let (mut whole, mut shape) = (None::<(f64, u32)>, None::<(f64, u32)>);
        let keep = |best: &mut Option<(f64, u32)>, found: f64, id: u32| {
            if best.is_none_or(|(best_deviation, _)| found < best_deviation) {
                *best = Some((found, id));
            }
        };
        for neighbor in near {
            let id = ids[neighbor.id as usize];
            let Some(geometry) = self.geometry(id as usize) else { continue };
            keep(&mut shape, geometry, id);
            if let Some(appearance) = self.appearance(id as usize) {
                keep(&mut whole, geometry + appearance, id);
            }
        }
        match (whole, shape) {
            (Some((_, id)), _) => Identity::Unchanged(id),
            (None, Some((_, id))) => Identity::Recolored(id),
            (None, None) => Identity::Edited,
        }
    }

    fn mean_limit(&self, axis: usize) -> f64 {
        let magnitude = f64::from(self.edited.means[self.row][axis]).abs();
        f64::from(self.precision.means[axis]) + ROUNDING * magnitude
    }

    /// Sum of squared deviations, in units of their limits; `None` if one exceeds its limit.
    fn geometry(&self, id: usize) -> Option<f64> {
        let (source, edited, row, precision) = (self.source, self.edited, self.row, self.precision);
        let mut sum = 0.0;
        for axis in 0..3 {
            let (from, to) = (source.means[id][axis], edited.means[row][axis]);
            sum += within((f64::from(from) - f64::from(to)).abs(), self.mean_limit(axis))?;
            let limit = f64::from(precision.log_scales[axis]) + 1e-5;
            let (from, to) = (source.log_scales[id][axis], edited.log_scales[row][axis]);
            sum += within(apart(from, to, precision.log_scale_range), limit)?;
        }
        let a = quat::normalize(source.quats[id].map(f64::from));
        let b = quat::normalize(edited.quats[row].map(f64::from));
        let angle = 2.0 * quat::dot(a, b).abs().min(1.0).acos();
        // The arc cosine of a product near 1 in single precision has an error of about the square
        // root of its rounding.
        sum += within(angle, f64::from(precision.rotation_rad) + 1e-3)?;
        Some(sum)
    }

    fn appearance(&self, id: usize) -> Option<f64> {
        let (source, edited, row, precision) = (self.source, self.edited, self.row, self.precision);
        let opacity = f64::from((source.opacity(id) - edited.opacity(row)).abs());
        let mut sum = within(opacity, f64::from(precision.opacity) + 1e-4)?;
        let (from, to) = (source.sh_of(id), edited.sh_of(row));
        for channel in 0..3 {
            let limit = f64::from(precision.sh_dc[channel]) + 1e-4;
            sum += within(apart(from[0][channel], to[0][channel], precision.sh_dc_range), limit)?;
        }
        for k in 1..from.len().max(to.len()) {
            let allowed = precision.sh_rest[if k < 4 {
                0
            } else if k < 9 {
                1
            } else {
                2
            }];
            if allowed.is_infinite() {
                continue;
            }
            let of = |sh: &[[f32; 3]]| sh.get(k).copied().unwrap_or([0.0; 3]);
            let (from, to) = (of(from), of(to));
            for channel in 0..3 {
                let distance = apart(from[channel], to[channel], precision.sh_rest_range);
                sum += within(distance, f64::from(allowed) + 1e-4)?;
            }
        }
        Some(sum)
    }
}

/// Distance of `stored` from the range of values that `value` may be stored as.
fn apart(value: f32, stored: f32, [min, max]: [f32; 2]) -> f64 {
    (f64::from(value.max(min).min(max)) - f64::from(stored)).abs()
}

/// Square of `distance` in units of `limit`; `None` beyond the limit.
fn within(distance: f64, limit: f64) -> Option<f64> {
    if limit.is_infinite() {
        return Some(0.0);
    }
    (distance <= limit).then(|| (distance / limit.max(f64::MIN_POSITIVE)).powi(2))
}
