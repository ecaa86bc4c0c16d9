//! Exact median of all pair distances between two clouds, without storing them.
//!
//! A random sample brackets the median; one pass over the tree then counts the pairs below the
//! bracket and collects those inside. Boxes entirely on one side are counted without visiting their
//! points. If the bracket is too wide, it is narrowed by interpolating the counts, so the result is
//! exact for any sample.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use crate::params::MedianMode;
use crate::simd::{LANES, dispatch};
use crate::tree::{Node, PointTree, box_distances};
use crate::{UotError, points};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Maximum number of pairs for which [`MedianMode::Auto`] is exact.
pub const MAX_EXACT_PAIRS: usize = 20_000_000_000;
/// Number of pairs that [`MedianMode::Auto`] draws above the limit: rank error 1.35e-3.
const AUTO_SAMPLES: usize = 4_000_000;
/// Probability that the true rank error exceeds the stated one.
const FAILURE: f64 = 1e-6;
/// Maximum number of squared distances stored at once (16 MiB).
const MAX_COLLECTED: usize = 1 << 21;
/// Maximum number of leaves of a box that is searched point by point.
const GROUP_LEAVES: u32 = 8;

/// Median distance between two clouds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MedianDistance {
    /// The median; for an even number of pairs the mean of the two middle distances. Unit of the
    /// points.
    pub value: f64,
    /// The lower of the two middle distances, unit of the points; for an odd number of pairs the
    /// middle one.
    pub lower: f64,
    /// Whether all pairs were ranked.
    pub exact: bool,
    /// Bound on `|rank/pairs − 1/2|` that holds with probability 1 − 10⁻⁶; zero when exact.
    pub rank_error: f64,
    /// Number of pairs ranked: n·m if exact, else the number drawn.
    pub pairs: usize,
}

/// Median of the `n·m` distances between `rows` `[n, D]` and `cols` `[m, D]`, unit of the points.
///
/// # Errors
/// [`UotError`] when a cloud is empty or has a coordinate that is not finite or beyond 1e150 in
/// magnitude, or when zero pairs are to be drawn.
pub fn median_distance<const D: usize>(
    rows: &[[f64; D]],
    cols: &[[f64; D]],
    mode: MedianMode,
) -> Result<MedianDistance, UotError> {
    points::validate("rows", "row", rows)?;
    points::validate("cols", "column", cols)?;
    let (rows, cols) = rayon::join(|| PointTree::new(rows), || PointTree::new(cols));
    median_of_trees(&rows, &cols, mode)
}

pub(crate) fn median_of_trees(
    rows: &PointTree,
    cols: &PointTree,
    mode: MedianMode,
) -> Result<MedianDistance, UotError> {
    let total = rows.len() * cols.len();
    match mode {
        MedianMode::Auto if total > MAX_EXACT_PAIRS => Ok(sampled(rows, cols, AUTO_SAMPLES, 0)),
        MedianMode::Auto | MedianMode::Exact => Ok(exact(rows, cols)),
        MedianMode::Sampled { pairs: 0, .. } => {
            let expected = "at least one pair";
            Err(UotError::BadParam { name: "pairs", value: 0.0, expected })
        }
        MedianMode::Sampled { pairs, seed } => Ok(sampled(rows, cols, pairs, seed)),
    }
}

fn squared_distance(rows: &PointTree, p: usize, cols: &PointTree, q: usize) -> f64 {
    let mut total = 0.0_f64;
    for axis in 0..rows.dim() {
        let t = rows.axis(axis)[p / LANES][p % LANES] - cols.axis(axis)[q / LANES][q % LANES];
        total = t.mul_add(t, total);
    }
    total
}

fn draw(rows: &PointTree, cols: &PointTree, count: usize, seed: u64) -> Vec<f64> {
    const PART: usize = 1 << 16;
    (0..count.div_ceil(PART))
        .into_par_iter()
        .flat_map_iter(|part| {
            let stream = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(part as u64);
            let mut rng = Pcg64Mcg::seed_from_u64(stream);
            let len = PART.min(count - part * PART);
            (0..len).map(move |_| {
                let p = rng.random_range(0..rows.len());
                let q = rng.random_range(0..cols.len());
                squared_distance(rows, p, cols, q)
            })
        })
        .collect()
}

fn sampled(rows: &PointTree, cols: &PointTree, pairs: usize, seed: u64) -> MedianDistance {
    let mut squares = draw(rows, cols, pairs, seed);
    let (lower, upper) = middle_pair(&mut squares, (pairs - 1) / 2, pairs / 2);
    MedianDistance {
        value: 0.5 * (lower.sqrt() + upper.sqrt()),
        lower: lower.sqrt(),
        exact: false,
        rank_error: ((2.0 / FAILURE).ln() / (2.0 * pairs as f64)).sqrt(),
        pairs,
    }
}

/// Elements of rank `low` and `high`, where `high` is `low` or the next.
fn middle_pair(values: &mut [f64], low: usize, high: usize) -> (f64, f64) {
    let (_, &mut lower, above) = values.select_nth_unstable_by(low, f64::total_cmp);
    let upper = if high == low { lower } else { smallest(above) };
    (lower, upper)
}

fn smallest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn exact(rows: &PointTree, cols: &PointTree) -> MedianDistance {
    let total = rows.len() * cols.len();
    let (low, high) = ((total - 1) / 2, total / 2);
    let (lower, upper) = select(rows, cols, low, high);
    MedianDistance {
        value: 0.5 * (lower.sqrt() + upper.sqrt()),
        lower: lower.sqrt(),
        exact: true,
        rank_error: 0.0,
        pairs: total,
    }
}

/// Squared distances of rank `low` and `high` (equal or consecutive) among all pairs.
fn select(rows: &PointTree, cols: &PointTree, low: usize, high: usize) -> (f64, f64) {
    let total = rows.len() * cols.len();
    let (mut bracket, mut expected) = first_bracket(rows, cols, total);
    // bounds that are known to enclose the rank, with the number of pairs below them
    let (mut floor, mut ceiling) = ((0.0_f64, 0_usize), (f64::MAX, total));
    let mut bisect = false;
    loop {
        let (from, to) = bracket;
        let scan = scan(rows, cols, from, to, expected <= MAX_COLLECTED);
        let (below, end) = (scan.below, scan.below + scan.inside);
        if low < below {
            ceiling = (from.next_down(), below);
        } else if low >= end {
            floor = (to.next_up(), end);
        } else if let Some(mut values) = scan.values {
            if high < end {
                return middle_pair(&mut values, low - below, high - below);
            }
            let lower = values.iter().copied().fold(0.0, f64::max);
            return (lower, smallest_above(rows, cols, to));
        } else {
            floor = (from, below);
            ceiling = (to, end);
        }
        if floor.0.to_bits() >= ceiling.0.to_bits() {
            // every pair inside has exactly this distance
            let upper =
                if high < ceiling.1 { floor.0 } else { smallest_above(rows, cols, floor.0) };
            return (floor.0, upper);
        }
        let between = ceiling.1 - floor.1;
        let width = MAX_COLLECTED / 3;
        // interpolation is much faster on smooth data; bisection of the bit pattern always
        // terminates
        (bracket, expected) = if between <= MAX_COLLECTED {
            ((floor.0, ceiling.0), between)
        } else if bisect || ceiling.0 >= f64::MAX {
            let middle = f64::from_bits(u64::midpoint(floor.0.to_bits(), ceiling.0.to_bits()));
            ((floor.0, middle), between / 2)
        } else {
            let at = (low - floor.1) as f64;
            let point = |rank: f64| {
                floor.0 + (rank / between as f64).clamp(0.0, 1.0) * (ceiling.0 - floor.0)
            };
            let (from, to) = (point(at - width as f64), point(at + width as f64));
            ((from, to.min(ceiling.0)), 2 * width)
        };
        bisect = !bisect;
    }
}

/// Quantiles of a sample, 2.5 standard deviations either side of its median, and the pairs expected
/// between them; the whole range for small problems.
fn first_bracket(rows: &PointTree, cols: &PointTree, total: usize) -> ((f64, f64), usize) {
    if total <= MAX_COLLECTED / 8 {
        return ((0.0, f64::MAX), total);
    }
    // a larger sample costs more than the values that a narrower bracket saves
    let count = (total / 1024).clamp(1 << 12, 1 << 18);
    let mut sample = draw(rows, cols, count, 0);
    // a rank has standard deviation √count / 2
    let reach = (5 * count.isqrt()).div_ceil(4);
    let (from, to) = (count / 2 - reach, count / 2 + reach);
    let upper = *sample.select_nth_unstable_by(to, f64::total_cmp).1;
    let lower = *sample.select_nth_unstable_by(from, f64::total_cmp).1;
    ((lower, upper), 2 * reach * (total / count))
}

struct Scan {
    /// Pairs with a squared distance below the bracket.
    below: usize,
    /// Pairs inside, both ends included.
    inside: usize,
    /// Their squared distances, unless there are too many.
    values: Option<Vec<f64>>,
}

fn scan(rows: &PointTree, cols: &PointTree, from: f64, to: f64, collect: bool) -> Scan {
    let collected = AtomicUsize::new(0);
    let parts: Vec<Scan> = rows
        .groups(GROUP_LEAVES)
        .into_par_iter()
        .map(|group| {
            let mut part = Scan { below: 0, inside: 0, values: collect.then(Vec::new) };
            scan_group(rows, group, cols, (from, to), &collected, &mut part);
            part
        })
        .collect();
    let below = parts.iter().map(|part| part.below).sum();
    let inside = parts.iter().map(|part| part.inside).sum();
    let complete = inside <= MAX_COLLECTED && parts.iter().all(|part| part.values.is_some());
    let values =
        complete.then(|| parts.into_iter().filter_map(|part| part.values).flatten().collect());
    Scan { below, inside, values }
}

/// Distances from boxes are rounded; this margin keeps a box from being counted on the wrong side.
const MARGIN: f64 = 1e-12;

enum Side {
    Below,
    Above,
    Across,
}

fn side(near: f64, far: f64, from: f64, to: f64) -> Side {
    if far * (1.0 + MARGIN) < from {
        Side::Below
    } else if near * (1.0 - MARGIN) > to {
        Side::Above
    } else {
        Side::Across
    }
}

fn scan_group(
    rows: &PointTree,
    group: usize,
    cols: &PointTree,
    (from, to): (f64, f64),
    collected: &AtomicUsize,
    part: &mut Scan,
) {
    let node = rows.node(group);
    let first = node.first_leaf as usize * LANES;
    let points = first..first + rows.count(node);
    let mut across: Vec<usize> = Vec::new();
    cols.walk(|id| {
        let (near, far) = box_distances(rows.bounds(group), cols.bounds(id));
        match side(near, far, from, to) {
            Side::Below => part.below += points.len() * cols.count(cols.node(id)),
            Side::Above => {}
            Side::Across if cols.node(id).num_leaves > GROUP_LEAVES => return true,
            Side::Across => across.push(id),
        }
        false
    });
    let mut squares = [0.0; GROUP_POINTS];
    let mut hits = [0.0; GROUP_POINTS];
    for p in points {
        let before = part.inside;
        let point: Vec<f64> = (0..rows.dim()).map(|k| rows.axis(k)[p / LANES][p % LANES]).collect();
        for &id in &across {
            let node = cols.node(id);
            let (near, far) = point_distances(&point, cols.bounds(id));
            match side(near, far, from, to) {
                Side::Below => {
                    part.below += cols.count(node);
                    continue;
                }
                Side::Above => continue,
                Side::Across => {}
            }
            let (below, inside) = dispatch(
                #[inline(always)]
                || count(&point, cols, node, from, to, &mut squares),
            );
            part.below += below;
            part.inside += inside;
            if let Some(values) = part.values.as_mut().filter(|_| inside > 0) {
                let found = select_inside(
                    &squares[..node.num_leaves as usize * LANES],
                    from,
                    to,
                    &mut hits,
                );
                values.extend_from_slice(&hits[..found]);
            }
        }
        let added = part.inside - before;
        if part.values.is_some()
            && collected.fetch_add(added, Ordering::Relaxed) + added > MAX_COLLECTED
        {
            part.values = None;
        }
    }
}

/// Minimum and maximum squared distance between a point and a box.
fn point_distances(point: &[f64], bounds: &[[f64; 2]]) -> (f64, f64) {
    let (mut near, mut far) = (0.0, 0.0);
    for (x, bound) in point.iter().zip(bounds) {
        let (below, above) = (bound[0] - x, x - bound[1]);
        let gap = below.max(above).max(0.0);
        let reach = below.min(above);
        near += gap * gap;
        far += reach * reach;
    }
    (near, far)
}

/// Largest number of points in a group.
const GROUP_POINTS: usize = GROUP_LEAVES as usize * LANES;

/// Squared distances of a node's points from one point, and their numbers below and inside the
/// bracket.
#[inline(always)]
fn count(
    point: &[f64],
    cols: &PointTree,
    node: Node,
    from: f64,
    to: f64,
    squares: &mut [f64; GROUP_POINTS],
) -> (usize, usize) {
    let mut below = [0_u64; LANES];
    let mut not_above = [0_u64; LANES];
    let num_leaves = node.num_leaves as usize;
    for (k, out) in squares.as_chunks_mut::<LANES>().0.iter_mut().take(num_leaves).enumerate() {
        let mut d = [0.0_f64; LANES];
        for (axis, x) in point.iter().enumerate() {
            let y = cols.axis(axis)[node.first_leaf as usize + k];
            for lane in 0..LANES {
                let t = x - y[lane];
                d[lane] = t.mul_add(t, d[lane]);
            }
        }
        for lane in 0..LANES {
            below[lane] += u64::from(d[lane] < from);
            not_above[lane] += u64::from(d[lane] <= to);
        }
        *out = d;
    }
    let total = |lanes: [u64; LANES]| lanes.iter().map(|&c| usize::try_from(c).unwrap_or(0)).sum();
    let (below, not_above): (usize, usize) = (total(below), total(not_above));
    (below, not_above - below)
}

/// Moves the values inside the bracket to the front of `hits`; returns their number.
#[expect(
    clippy::needless_bitwise_bool,
    reason = "a branch here would be mispredicted half the time"
)]
fn select_inside(squares: &[f64], from: f64, to: f64, hits: &mut [f64; GROUP_POINTS]) -> usize {
    let mut found = 0;
    for &value in squares {
        hits[found % GROUP_POINTS] = value;
        found += usize::from((value >= from) & (value <= to));
    }
    found
}

/// Smallest squared distance above a bound.
fn smallest_above(rows: &PointTree, cols: &PointTree, bound: f64) -> f64 {
    rows.groups(GROUP_LEAVES)
        .into_par_iter()
        .map(|group| {
            let node = rows.node(group);
            let first = node.first_leaf as usize * LANES;
            let mut best = f64::INFINITY;
            cols.walk(|id| {
                let (near, far) = box_distances(rows.bounds(group), cols.bounds(id));
                if near * (1.0 - MARGIN) > best || far * (1.0 + MARGIN) < bound {
                    return false;
                }
                let target = cols.node(id);
                if target.num_leaves == 1 {
                    let start = target.first_leaf as usize * LANES;
                    for p in first..first + rows.count(node) {
                        for q in start..start + cols.count(target) {
                            let d = squared_distance(rows, p, cols, q);
                            if d > bound && d < best {
                                best = d;
                            }
                        }
                    }
                }
                true
            });
            best
        })
        .reduce(|| f64::INFINITY, f64::min)
}
