//! Selections by distance: near, grow, shrink, connected.

use anchors::{KdTree, Neighbor, Neighbors};
use gs_core::nearest_rank;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Up to this many pairs of two cells are compared directly; for more, a tree finds the nearest.
const MAX_PAIRS: usize = 4096;

/// With gaps below this share of the cloud's extent, only coincident points are linked.
const MIN_GAP: f64 = 1e-12;

/// Default gap, in median distances of nearest neighbours.
const GAPS: f64 = 3.0;

type Point = [f64; 3];

/// Flags of the `points` at most `reach` from one of `sources`; not set for points that are not
/// finite.
pub(crate) fn within(points: &[Point], sources: &[Point], reach: f64) -> Vec<bool> {
    let sources: Vec<Point> = sources.iter().copied().filter(finite).collect();
    if sources.is_empty() {
        return vec![false; points.len()];
    }
    let tree = KdTree::new(&sources);
    points
        .par_iter()
        .with_min_len(256)
        .map_init(Vec::new, |found: &mut Vec<Neighbor>, point| {
            if !finite(point) {
                return false;
            }
            tree.nearest(point, 1, found);
            found.first().is_some_and(|n| n.distance_squared.sqrt() <= reach)
        })
        .collect()
}

/// Three times the median distance of nearest neighbours, 0 for fewer than two points.
pub(crate) fn default_gap(points: &[Point]) -> f64 {
    let points: Vec<Point> = points.iter().copied().filter(finite).collect();
    if points.len() < 2 {
        return 0.0;
    }
    let nearest = Neighbors::of(&points, 1);
    let mut distances: Vec<f64> =
        (0..points.len()).flat_map(|i| nearest.get(i).map(|n| n.distance_squared.sqrt())).collect();
    GAPS * nearest_rank(&mut distances, 0.5).unwrap_or(0.0)
}

/// Flags of the `points` connected to the one nearest to `seed` (the first of equally near ones) by
/// steps of at most `gap`. No flag is set if there is no finite point.
pub(crate) fn connected(points: &[Point], seed: Point, gap: f64) -> Vec<bool> {
    let mut selected = vec![false; points.len()];
    let usable: Vec<usize> = (0..points.len()).filter(|&i| finite(&points[i])).collect();
    let nearest = usable.iter().copied().min_by(|&a, &b| {
        distance_squared(&points[a], &seed).total_cmp(&distance_squared(&points[b], &seed))
    });
    let Some(nearest) = nearest else { return selected };
    let (mut low, mut high) = (points[nearest], points[nearest]);
    for &i in &usable {
        for axis in 0..3 {
            low[axis] = low[axis].min(points[i][axis]);
            high[axis] = high[axis].max(points[i][axis]);
        }
    }
    let extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    let gap = gap.max(MIN_GAP * extent);
    // Points of one cell are never farther apart than the gap.
    let edge = gap / 3.0_f64.sqrt();
    let cell_of = |point: &Point| -> [i64; 3] {
        #[expect(clippy::cast_possible_truncation, reason = "at most 2e12, or 0 if all coincide")]
        [0, 1, 2].map(|axis| {
            if edge > 0.0 { ((point[axis] - low[axis]) / edge).floor() as i64 } else { 0 }
        })
    };
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for &i in &usable {
        cells.entry(cell_of(&points[i])).or_default().push(i);
    }
    let start = cell_of(&points[nearest]);
    let mut waiting = vec![start];
    let mut reached = BTreeSet::from([start]);
    while let Some(cell) = waiting.pop() {
        for neighbor in around(cell) {
            let Some(others) = cells.get(&neighbor) else { continue };
            if !reached.contains(&neighbor) && touch(points, &cells[&cell], others, gap) {
                reached.insert(neighbor);
                waiting.push(neighbor);
            }
        }
    }
    for cell in &reached {
        for &i in &cells[cell] {
            selected[i] = true;
        }
    }
    selected
}

/// The cells of points at most one gap away.
fn around([x, y, z]: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (-2..=2)
        .flat_map(move |i| (-2..=2).flat_map(move |j| (-2..=2).map(move |k| [x + i, y + j, z + k])))
}

/// Whether a point of one cell is at most `gap` from one of the other.
fn touch(points: &[Point], a: &[usize], b: &[usize], gap: f64) -> bool {
    if a.len() * b.len() <= MAX_PAIRS {
        return a
            .iter()
            .any(|&i| b.iter().any(|&j| distance_squared(&points[i], &points[j]).sqrt() <= gap));
    }
    let of = |rows: &[usize]| -> Vec<Point> { rows.iter().map(|&i| points[i]).collect() };
    let (few, many) = if a.len() < b.len() { (of(a), of(b)) } else { (of(b), of(a)) };
    let tree = KdTree::new(&many);
    let mut found = Vec::new();
    few.iter().any(|point| {
        tree.nearest(point, 1, &mut found);
        found.first().is_some_and(|n| n.distance_squared.sqrt() <= gap)
    })
}

fn finite(point: &Point) -> bool {
    point.iter().all(|v| v.is_finite())
}

fn distance_squared(a: &Point, b: &Point) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// The definition: breadth-first over all pairs.
    fn by_pairs(points: &[Point], seed: Point, gap: f64) -> Vec<bool> {
        let order = |a: &usize, b: &usize| {
            distance_squared(&points[*a], &seed).total_cmp(&distance_squared(&points[*b], &seed))
        };
        let mut selected = vec![false; points.len()];
        let mut waiting: Vec<usize> = (0..points.len()).min_by(order).into_iter().collect();
        while let Some(i) = waiting.pop() {
            if std::mem::replace(&mut selected[i], true) {
                continue;
            }
            let near = |j: &usize| distance_squared(&points[i], &points[*j]).sqrt() <= gap;
            waiting.extend((0..points.len()).filter(|&j| !selected[j]).filter(near));
        }
        selected
    }

    #[test]
    fn connected_points_are_those_of_the_definition() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let points: Vec<Point> =
            (0..700).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect();
        for gap in [0.0, 0.05, 0.12, 0.17, 0.2, 0.5, 9.0] {
            let found = connected(&points, [0.1, 0.2, 0.3], gap);
            assert_eq!(found, by_pairs(&points, [0.1, 0.2, 0.3], gap), "gap {gap}");
        }
    }

    #[test]
    fn coincident_and_non_finite_points_have_results() {
        let same = vec![[1.0, 2.0, 3.0]; 50];
        assert_eq!(connected(&same, [0.0; 3], 0.0), vec![true; 50], "coincident");
        let odd = [[f64::NAN; 3], [0.0; 3], [f64::INFINITY; 3], [3e38, 0.0, 0.0]];
        assert_eq!(connected(&odd, [0.0; 3], 1.0), [false, true, false, false], "hostile");
        assert_eq!(connected(&[], [0.0; 3], 1.0), Vec::<bool>::new(), "nothing");
        assert_eq!(
            within(&odd, &odd, 1e300),
            [false, true, false, true],
            "points that are not finite"
        );
        assert_eq!(default_gap(&same[..1]), 0.0, "one point has no neighbour");
    }

    #[test]
    fn large_cells_are_compared_by_tree() {
        let cluster = |x: f64| (0..400).map(move |i| [x, f64::from(i) * 1e-4, 0.0]);
        let points: Vec<Point> = cluster(0.0).chain(cluster(0.9)).chain(cluster(2.5)).collect();
        let found = connected(&points, [0.0; 3], 1.0);
        assert_eq!(found.iter().filter(|&&f| f).count(), 800, "two of three clusters");
    }
}
