//! Edited splats that are source splats within rounding.

use super::row::Identity;
use crate::row_index::index;
use anchors::KdTree;
use gs_core::{Real, Splats, covariance, quat};
use rayon::prelude::*;

/// Number of source splats compared with each open row.
const CANDIDATES: usize = 4;

pub(super) fn match_by_tolerance(
    source: &Splats,
    edited: &Splats,
    tolerance: f64,
    rows: &mut [Identity],
) {
    let ids: Vec<u32> = (0..source.len()).filter(|&i| source.is_finite(i)).map(index).collect();
    if ids.is_empty() || rows.iter().all(|row| *row != Identity::Edited) {
        return;
    }
    let points: Vec<[f64; 3]> =
        ids.iter().map(|&id| source.means[id as usize].map(f64::from)).collect();
    // The distance limit depends on the middle scale.
    let middle = |id: &u32| sorted(source.scale(*id as usize).map(f64::from))[1];
    let middles: Vec<f64> = ids.par_iter().with_min_len(1024).map(middle).collect();
    let open: Vec<usize> = (0..rows.len())
        .filter(|&row| rows[row] == Identity::Edited && edited.is_finite(row))
        .collect();
    let places: Vec<[f64; 3]> = open.iter().map(|&row| edited.means[row].map(f64::from)).collect();
    // Upper bound of the distance of splats in place: √3 times the limit per coordinate, and
    // rounding.
    let largest = places.iter().chain(&points).map(|&x| largest_coordinate(x)).fold(0.0, f64::max);
    let reach = 3.0_f64.sqrt()
        * position_limit(largest, middles.iter().copied().fold(0.0, f64::max), tolerance);
    let found = KdTree::<3>::new(&points).map_within(&places, CANDIDATES, reach, |i, near| {
        let near = near.iter().filter(|n| {
            let n = n.id as usize;
            is_in_place(points[n], places[i], middles[n], tolerance)
        });
        best_within(source, edited, open[i], near.map(|n| ids[n.id as usize]), tolerance)
    });
    for (row, found) in open.into_iter().zip(found) {
        rows[row] = found;
    }
}

fn sorted(mut values: [f64; 3]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    values
}

/// Whether two positions agree within the rounding of coordinates, or within a small share of the
/// splat's size.
fn is_in_place(x: [f64; 3], y: [f64; 3], middle_scale: f64, tolerance: f64) -> bool {
    let limit = position_limit(largest_coordinate(x), middle_scale, tolerance);
    (0..3).all(|axis| (x[axis] - y[axis]).abs() <= limit)
}

/// Maximum difference of a coordinate due to rounding, world units.
fn position_limit(largest_coordinate: f64, middle_scale: f64, tolerance: f64) -> f64 {
    tolerance * (2e-6 * largest_coordinate).max(1e-3 * middle_scale)
}

fn largest_coordinate(x: [f64; 3]) -> f64 {
    x.iter().fold(0.0, |m, c| m.max(c.abs()))
}

fn best_within(
    source: &Splats,
    edited: &Splats,
    row: usize,
    near: impl Iterator<Item = u32>,
    tolerance: f64,
) -> Identity {
    let mut best = Identity::Edited;
    for id in near {
        if !geometry_within(source, id as usize, edited, row, tolerance) {
            continue;
        }
        if appearance_within(source, id as usize, edited, row, tolerance) {
            return Identity::Unchanged(id);
        }
        if best == Identity::Edited {
            best = Identity::Recolored(id);
        }
    }
    best
}

fn geometry_within(source: &Splats, s: usize, edited: &Splats, e: usize, tolerance: f64) -> bool {
    let (x, y) = (source.means[s].map(f64::from), edited.means[e].map(f64::from));
    let (sx, sy) = (source.scale(s).map(f64::from), edited.scale(e).map(f64::from));
    let (sorted_x, sorted_y) = (sorted(sx), sorted(sy));
    if !is_in_place(x, y, sorted_x[1], tolerance) {
        return false;
    }
    let close = |a: [f64; 3], b: [f64; 3]| {
        (0..3).all(|i| (a[i] - b[i]).abs() <= tolerance * 1e-3 * a[i].max(b[i]))
    };
    if !close(sorted_x, sorted_y) {
        return false;
    }
    let qx = quat::normalize(source.quats[s].map(f64::from));
    let qy = quat::normalize(edited.quats[e].map(f64::from));
    // 1 − |⟨q,q'⟩| = θ²/8.
    let same_rotation = 1.0 - quat::dot(qx, qy).abs() <= 5e-7 * tolerance * tolerance;
    if same_rotation && close(sx, sy) {
        return true;
    }
    let (a, b) = (covariance(qx, sx), covariance(qy, sy));
    let difference = (0..6).fold(0.0_f64, |m, i| m.max((a[i] - b[i]).abs()));
    difference <= 5e-3 * tolerance * sorted_x[2] * sorted_x[2]
}

pub(super) fn appearance_within(
    source: &Splats,
    s: usize,
    edited: &Splats,
    e: usize,
    tolerance: f64,
) -> bool {
    let tolerance = tolerance.as_f32();
    let near = |a: f32, b: f32, limit: f32| a == b || (a - b).abs() <= limit;
    if !near(source.opacity(s), edited.opacity(e), 2e-3 * tolerance) {
        return false;
    }
    let padded =
        |splats: &Splats, i: usize, k: usize| splats.sh_of(i).get(k).copied().unwrap_or([0.0; 3]);
    (0..source.sh_coeffs().max(edited.sh_coeffs())).all(|k| {
        let (a, b) = (padded(source, s, k), padded(edited, e, k));
        (0..3).all(|channel| near(a[channel], b[channel], 1e-3 * tolerance))
    })
}
