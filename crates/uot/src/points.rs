//! Checks on point clouds.

use crate::UotError;

/// Maximum number of points on a side: ids are stored as `u32`.
const MAX_POINTS: usize = 1 << 31;
/// Largest coordinate whose squared differences stay finite.
const MAX_COORDINATE: f64 = 1e150;

pub(crate) fn validate<const D: usize>(
    what: &'static str,
    side: &'static str,
    points: &[[f64; D]],
) -> Result<(), UotError> {
    if points.is_empty() {
        return Err(UotError::Empty { side });
    }
    if points.len() > MAX_POINTS {
        return Err(UotError::TooLarge { what, needed: points.len(), limit: MAX_POINTS });
    }
    for (index, point) in points.iter().enumerate() {
        let bad = |x: &&f64| x.is_nan() || x.abs() > MAX_COORDINATE;
        if let Some(&value) = point.iter().find(bad) {
            let expected = "finite coordinates of magnitude at most 1e150";
            return Err(UotError::BadValue { what, index, value, expected });
        }
    }
    Ok(())
}
