//! The cylinder test: lines that hit neighbourhoods.

use rayon::prelude::*;

use crate::grid::{Entry, Grid};
use crate::vec3::{Vec3, add, scale};
use crate::{Line, Lines, Neighborhoods};

/// The retained line of a neighbourhood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    /// Largest squared distance of a member from the line, world units².
    pub(crate) distance2: f64,
    /// Line id.
    pub(crate) line: u32,
}

impl Hit {
    #[inline]
    fn improves(&self, other: &Self) -> bool {
        self.distance2 < other.distance2
            || (self.distance2 <= other.distance2 && self.line < other.line)
    }
}

/// Tasks per thread: enough to balance the load, few enough to keep their result arrays small.
const TASKS_PER_THREAD: usize = 4;

/// Maximum number of grids; smaller radii share the finest.
const MAX_LEVELS: usize = 12;

/// For every neighbourhood, the line with the smallest maximum distance to its members, if that is
/// at most `deltas[i]`; ties to the lowest line id. `None` where no line hits, and where
/// `deltas[i]` is 0.
pub(crate) fn best_lines(
    points: &[Vec3],
    neighborhoods: &Neighborhoods,
    deltas: &[f64],
    lines: &Lines,
) -> Vec<Option<Hit>> {
    let probe = Probe::new(points, neighborhoods, deltas);
    let tasks = rayon::current_num_threads() * TASKS_PER_THREAD;
    let chunk = lines.len().div_ceil(tasks).max(1);
    // The minimum of a total order does not depend on the division of the lines into chunks.
    let best = lines
        .as_slice()
        .par_chunks(chunk)
        .enumerate()
        .map(|(i, part)| probe.run(part, (i * chunk) as u32))
        .reduce_with(|mut a, b| {
            for (x, y) in a.iter_mut().zip(b) {
                if y.improves(x) {
                    *x = y;
                }
            }
            a
        });
    let best = best.unwrap_or_else(|| probe.misses.clone());
    best.into_iter().map(|hit| (hit.line != u32::MAX).then_some(hit)).collect()
}

/// Level of a radius: radii from `widest / 2^(level + 1)` to `widest / 2^level` share a grid.
fn level_of(delta: f64, widest: f64) -> usize {
    let halvings = (1..MAX_LEVELS).take_while(|level| delta * (1_u64 << level) as f64 <= widest);
    halvings.count()
}

struct Probe<'a> {
    neighborhoods: &'a Neighborhoods,
    /// Coordinates of all members, in the order of the indices.
    corners: Vec<Vec3>,
    grids: Vec<Grid>,
    /// Initial hit of every neighbourhood: δ², with an id above all lines.
    misses: Vec<Hit>,
}

impl<'a> Probe<'a> {
    fn new(points: &[Vec3], neighborhoods: &'a Neighborhoods, deltas: &[f64]) -> Self {
        let corners: Vec<Vec3> =
            neighborhoods.indices().iter().map(|id| points[*id as usize]).collect();
        let widest = deltas.iter().copied().fold(0.0, f64::max);
        let mut levels = vec![Vec::new(); MAX_LEVELS];
        for (i, delta) in deltas.iter().enumerate().filter(|(_, delta)| **delta > 0.0) {
            let members = neighborhoods.range(i);
            let size = members.len() as f64;
            let sum = corners[members].iter().fold([0.0; 3], |sum, p| add(&sum, p));
            let level = level_of(*delta, widest);
            levels[level].push(Entry { center: scale(&sum, 1.0 / size), id: i as u32 });
        }
        let largest = corners.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        let grids = levels
            .iter()
            .enumerate()
            .filter(|(_, balls)| !balls.is_empty())
            .map(|(level, balls)| {
                let radius = widest / (1_u64 << level) as f64;
                // Margin for rounding of the centroids, the distances and the walk.
                Grid::new(balls, radius * (1.0 + 1e-9) + largest * 1e-12)
            })
            .collect();
        let misses =
            deltas.iter().map(|delta| Hit { distance2: delta * delta, line: u32::MAX }).collect();
        Self { neighborhoods, corners, grids, misses }
    }

    fn run(&self, lines: &[Line], first_id: u32) -> Vec<Hit> {
        let mut best = self.misses.clone();
        for grid in &self.grids {
            let reach2 = grid.reach() * grid.reach();
            for (line, id) in lines.iter().zip(first_id..) {
                grid.walk(line, |entries| {
                    for entry in entries {
                        // The cylinder is convex: if it contains all members, it contains their
                        // centroid.
                        if line.distance_squared(&entry.center) <= reach2 {
                            self.test(line, id, entry.id, &mut best[entry.id as usize]);
                        }
                    }
                });
            }
        }
        best
    }

    fn test(&self, line: &Line, id: u32, neighborhood: u32, best: &mut Hit) {
        let mut distance2 = 0.0;
        for corner in &self.corners[self.neighborhoods.range(neighborhood as usize)] {
            distance2 = line.distance_squared(corner).max(distance2);
            if distance2 > best.distance2 {
                return;
            }
        }
        let hit = Hit { distance2, line: id };
        if hit.improves(best) {
            *best = hit;
        }
    }
}
