//! The smallest sphere around a set of points: the sphere S of Eq. 5.
//!
//! Farthest-point pivoting. A support of at most four points determines a ball. The point farthest
//! outside is added, and the support of these five is found by trying all subsets. The radius grows
//! at every step, so the loop terminates, and a ball that contains all points is optimal. About ten
//! passes over the points suffice in practice.

use rayon::prelude::*;

use crate::AnchorError;
use crate::points::{Coordinate, distance_squared, lexicographic, widen};
use crate::vec3::{add, cross, dot, scale, sub};

/// A sphere, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// Centre, world frame.
    pub center: [f64; 3],
    /// Radius; 0 when all points coincide.
    pub radius: f64,
}

/// Maximum number of pivots; only rounding could reach it.
const MAX_PIVOTS: usize = 1000;

/// Points per parallel task of a farthest-point scan.
const SCAN_CHUNK: usize = 16_384;

impl BoundingSphere {
    /// Minimum enclosing sphere of a cloud `[N,3]`, unique and therefore independent of point
    /// order, down to the last bit.
    ///
    /// Exact up to rounding: every point is inside, and the radius exceeds the smallest possible
    /// one by about 1e-15 relative (1e-12 is tested). One point gives radius 0.
    ///
    /// # Errors
    /// Empty cloud; a coordinate that is not finite or beyond ±1e50.
    pub fn of<T: Coordinate>(points: &[[T; 3]]) -> Result<Self, AnchorError> {
        Ok(min_ball(&widen(points)?))
    }

    /// Minimum enclosing sphere of several clouds together. Empty clouds are skipped.
    ///
    /// # Errors
    /// No point at all; a coordinate that is not finite or beyond ±1e50 (its index is relative to
    /// its cloud).
    pub fn of_union<T: Coordinate>(clouds: &[&[[T; 3]]]) -> Result<Self, AnchorError> {
        let mut all = Vec::new();
        for cloud in clouds.iter().filter(|cloud| !cloud.is_empty()) {
            all.extend(widen(cloud)?);
        }
        if all.is_empty() { Err(AnchorError::EmptyCloud) } else { Ok(min_ball(&all)) }
    }
}

fn min_ball(points: &[[f64; 3]]) -> BoundingSphere {
    let first = points.iter().copied().reduce(|a, b| lexicographic_min(&a, &b));
    let mut center = first.expect("callers pass at least one point");
    let mut support = vec![center];
    let mut radius2 = 0.0;
    for _ in 0..MAX_PIVOTS {
        let (far2, far) = farthest(points, &center);
        if far2 <= radius2 {
            break;
        }
        support.push(far);
        support.sort_unstable_by(lexicographic);
        let (next_center, next_radius2, next_support) = ball_of_few(&support);
        if next_radius2 <= radius2 {
            // `far` is outside by less than rounding.
            break;
        }
        (center, radius2, support) = (next_center, next_radius2, next_support);
    }
    BoundingSphere { center, radius: farthest(points, &center).0.sqrt() }
}

fn lexicographic_min(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    if lexicographic(b, a).is_lt() { *b } else { *a }
}

/// Squared distance and position of the point farthest from `center`; ties go to the
/// lexicographically smallest, for any order of the points.
fn farthest(points: &[[f64; 3]], center: &[f64; 3]) -> (f64, [f64; 3]) {
    let scan = |chunk: &[[f64; 3]]| {
        let mut best2 = -1.0;
        let mut best = *center;
        for p in chunk {
            let d2 = distance_squared(p, center);
            if d2 > best2 {
                (best2, best) = (d2, *p);
            } else if d2 >= best2 {
                best = lexicographic_min(&best, p);
            }
        }
        (best2, best)
    };
    points.par_chunks(SCAN_CHUNK).map(scan).reduce(
        || (-1.0, *center),
        |a, b| match a.0.total_cmp(&b.0) {
            std::cmp::Ordering::Less => b,
            std::cmp::Ordering::Greater => a,
            std::cmp::Ordering::Equal => (a.0, lexicographic_min(&a.1, &b.1)),
        },
    )
}

/// Smallest ball around at most five points: centre, squared radius, and its support.
///
/// The circumcentres of all subsets of two to four points are candidates; the one with the smallest
/// distance to its farthest point is chosen. Comparing farthest distances, rather than testing
/// containment, needs no tolerance.
fn ball_of_few(points: &[[f64; 3]]) -> ([f64; 3], f64, Vec<[f64; 3]>) {
    let mut best = (points[0], f64::INFINITY, vec![points[0]]);
    for mask in 1_u32..1 << points.len() {
        let subset: Vec<[f64; 3]> =
            (0..points.len()).filter(|i| mask >> i & 1 == 1).map(|i| points[i]).collect();
        let Some(center) = circumcenter(&subset) else { continue };
        let radius2 = points.iter().map(|p| distance_squared(p, &center)).fold(0.0, f64::max);
        if radius2 < best.1 {
            best = (center, radius2, subset);
        }
    }
    best
}

/// Centre of the smallest sphere through two to four affinely independent points.
fn circumcenter(points: &[[f64; 3]]) -> Option<[f64; 3]> {
    let origin = points[0];
    let offset = match *points {
        [_] => [0.0; 3],
        [_, b] => scale(&sub(&b, &origin), 0.5),
        [_, b, c] => {
            let (u, v) = (sub(&b, &origin), sub(&c, &origin));
            let normal = cross(&u, &v);
            let sum = add(
                &scale(&cross(&v, &normal), dot(&u, &u)),
                &scale(&cross(&normal, &u), dot(&v, &v)),
            );
            scale(&sum, 0.5 / dot(&normal, &normal))
        }
        [_, b, c, d] => {
            let (u, v, w) = (sub(&b, &origin), sub(&c, &origin), sub(&d, &origin));
            let sum = add(
                &add(&scale(&cross(&v, &w), dot(&u, &u)), &scale(&cross(&w, &u), dot(&v, &v))),
                &scale(&cross(&u, &v), dot(&w, &w)),
            );
            scale(&sum, 0.5 / dot(&u, &cross(&v, &w)))
        }
        _ => return None,
    };
    offset.iter().all(|x| x.is_finite()).then(|| add(&origin, &offset))
}
