//! Input points: validation, and the order that makes results independent of input order.

use rayon::prelude::*;

use crate::AnchorError;

/// A coordinate type: `f32` or `f64`. All arithmetic is in `f64`.
pub trait Coordinate: Copy + Into<f64> + Send + Sync {}
impl Coordinate for f32 {}
impl Coordinate for f64 {}

/// Larger magnitudes would overflow when squared.
pub(crate) const MAX_MAGNITUDE: f64 = 1e50;

/// Checks a cloud and widens it to `f64`; `-0.0` becomes `0.0` so that equal points have equal
/// bits.
pub(crate) fn widen<T: Coordinate>(points: &[[T; 3]]) -> Result<Vec<[f64; 3]>, AnchorError> {
    if points.is_empty() {
        return Err(AnchorError::EmptyCloud);
    }
    let limit = u32::MAX as usize - 1;
    if points.len() > limit {
        return Err(AnchorError::TooMany { what: "points", found: points.len(), limit });
    }
    let wide: Vec<[f64; 3]> = points.iter().map(|p| p.map(|x| x.into() + 0.0)).collect();
    match first_bad(&wide) {
        Some((point, axis, value)) => Err(AnchorError::BadPoint { point, axis, value }),
        None => Ok(wide),
    }
}

/// First entry that is not a finite number of acceptable size.
pub(crate) fn first_bad<const D: usize>(rows: &[[f64; D]]) -> Option<(usize, usize, f64)> {
    rows.iter().enumerate().find_map(|(i, row)| {
        let axis = row.iter().position(|x| x.is_nan() || x.abs() > MAX_MAGNITUDE)?;
        Some((i, axis, row[axis]))
    })
}

/// Compares two rows entry by entry; all entries are finite.
pub(crate) fn lexicographic<const D: usize>(a: &[f64; D], b: &[f64; D]) -> std::cmp::Ordering {
    for d in 0..D {
        let order = a[d].total_cmp(&b[d]);
        if order.is_ne() {
            return order;
        }
    }
    std::cmp::Ordering::Equal
}

/// Ids of the rows in lexicographic order; equal rows keep the order of the input.
pub(crate) fn id_from_rank<const D: usize>(rows: &[[f64; D]]) -> Vec<u32> {
    let mut keyed: Vec<(f64, u32)> = rows.iter().zip(0u32..).map(|(r, id)| (r[0], id)).collect();
    keyed.par_sort_unstable_by(|a, b| {
        a.0.total_cmp(&b.0)
            .then_with(|| lexicographic(&rows[a.1 as usize], &rows[b.1 as usize]))
            .then(a.1.cmp(&b.1))
    });
    keyed.into_iter().map(|(_, id)| id).collect()
}

/// Squared Euclidean distance.
#[inline]
pub(crate) fn distance_squared<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let mut sum = 0.0;
    for d in 0..D {
        sum += (a[d] - b[d]) * (a[d] - b[d]);
    }
    sum
}
