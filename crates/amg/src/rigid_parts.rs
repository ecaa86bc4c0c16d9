//! [`RigidParts`]: the moving splats of a scene, and their rigid parts.

use crate::AmgError;
use crate::dynamics::DynamicSplit;
use crate::keyframes::KeyFrames;
use crate::options::MotionOptions;
use crate::rigid::{eigen, sub};
use anchors::{CellParams, Cells, NO_CELL, RigidNeighbors, Trajectories};
use gs_core::DynamicScene;
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// Edge of the cells from which parts are assembled, as a share of the moving figure.
const CELL_SIZE: f64 = 0.03;

/// Minimum edge of the cells in spacings: smaller ones would be single splats, whose rotation
/// is unknown.
const SPACINGS: f64 = 2.0;

/// Largest relative change of distances within a rigid body, as [`crate::MotionParams::strain`].
const STRAIN: f64 = 0.04;

/// Root mean square residual, as a share of the moving figure, up to which two groups count as one
/// rigid body. The figure of the demo is divided into head, chest, hips, upper arms, forearms,
/// thighs and shins.
const MISFIT: f64 = 0.01;

/// Share of the moving splats below which a group joins the neighbour that it fits best: fragments
/// are not parts.
const FRAGMENT: f64 = 0.01;

/// Rigid parts of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidParts {
    /// Flags of the moving splats ([`DynamicSplit`]), `[N]`.
    pub moving: Vec<bool>,
    /// Part of each splat, `[N]`: 1 is the part with the most splats; 0 for splats that do not
    /// move, or move unlike all others.
    pub parts: Vec<u32>,
    /// Number of parts.
    pub num_parts: u32,
}

impl RigidParts {
    /// Finds the parts of the scene, in its state at time `t`.
    ///
    /// Moving splats are grouped in small cells of neighbours that move as one ([`Cells`]); then,
    /// adjacent groups `a` and `b` are joined, in ascending order of
    /// `√((E(a∪b) − E(a) − E(b)) / min(n_a, n_b))`, where `E` is the largest squared error over the
    /// key times of the best rigid motion of a group; up to 1 % of the moving figure's size. Groups
    /// of less than 1 % of the moving splats join the neighbour they fit best. `progress` receives
    /// the share done, 0 to 1.
    ///
    /// # Errors
    /// If the scene cannot be evaluated.
    pub fn of(scene: &dyn DynamicScene, t: f32, progress: &dyn Fn(f32)) -> Result<Self, AmgError> {
        let options = MotionOptions::default();
        let keys = KeyFrames::of(scene, t, options.num_key_times, progress)?;
        let split = DynamicSplit::of(&keys, scene.dynamic_mask(), &options.dynamics)?;
        let num = keys.at_edit.len();
        let ids: Vec<usize> = (0..num).filter(|&i| split.dynamic[i]).collect();
        let mut parts = vec![0; num];
        let mut num_parts = 0;
        if split.figure_size > 0.0 && ids.len() > 1 && !keys.times.is_empty() {
            let points = trajectories(&keys, &ids);
            let groups = groups(&points, split.figure_size);
            for (number, members) in (1..).zip(groups) {
                for point in members {
                    parts[ids[point]] = number;
                }
                num_parts = number;
            }
        }
        Ok(Self { moving: split.dynamic, parts, num_parts })
    }
}

fn trajectories(keys: &KeyFrames, ids: &[usize]) -> Trajectories {
    // Relative to one of them, so that scenes far from the origin do not lose precision.
    let origin = keys.at_edit.means[ids[0]].map(f64::from);
    let pick = |means: &[[f32; 3]], i: usize| sub(means[i].map(f64::from), origin);
    let moved = |&i: &usize| keys.means.iter().map(move |means| pick(means, i));
    let present = |&i: &usize| (0..keys.times.len()).map(move |k| keys.seen(k, i));
    Trajectories {
        rest: ids.iter().map(|&i| pick(&keys.at_edit.means, i)).collect(),
        moved: ids.iter().flat_map(moved).collect(),
        presence: if keys.fades() { ids.iter().flat_map(present).collect() } else { Vec::new() },
        weights: vec![1.0; ids.len()],
        moving: vec![true; ids.len()],
    }
}

/// Groups of points that move together, largest first.
fn groups(points: &Trajectories, figure_size: f64) -> Vec<Vec<usize>> {
    let neighbors = RigidNeighbors::of(points, STRAIN);
    let outliers = neighbors.outliers(points);
    let edge = (CELL_SIZE * figure_size).max(SPACINGS * neighbors.typical_spacing(points));
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let no_directions = vec![[0.0; 3]; points.len()];
    let cells =
        Cells::build(points, &neighbors, &outliers, &no_directions, &CellParams { edge, axes });
    let mut near: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); cells.len()];
    for i in 0..points.len() {
        for (neighbor, _) in neighbors.get(i) {
            let (a, b) = (cells.owners[i], cells.owners[neighbor.id as usize]);
            if a != b && a != NO_CELL && b != NO_CELL {
                near[a as usize].insert(b as usize);
                near[b as usize].insert(a as usize);
            }
        }
    }
    let mut merging = Merging {
        moments: cells.members.iter().map(|members| Moments::of(points, members)).collect(),
        near,
        version: vec![0; cells.len()],
        alive: vec![true; cells.len()],
        joined: (0..cells.len()).map(|cell| vec![cell]).collect(),
    };
    let fragment = FRAGMENT * points.len() as f64;
    merging.run(MISFIT * figure_size, fragment);
    let mut groups: Vec<Vec<usize>> = (0..cells.len())
        .filter(|&group| merging.alive[group])
        .map(|group| {
            let members = merging.joined[group].iter().flat_map(|&cell| &cells.members[cell]);
            let mut points: Vec<usize> = members.map(|&point| point as usize).collect();
            points.sort_unstable();
            points
        })
        .filter(|members| members.len() as f64 >= fragment)
        .collect();
    groups.sort_by_key(|members| (Reverse(members.len()), members[0]));
    groups
}

/// PairSums over a group from which the error of its best rigid motion follows, at each key time.
#[derive(Debug, Clone)]
struct Moments {
    num: f64,
    at: Vec<PairSums>,
    /// Largest squared error over the key times.
    error: f64,
}

/// Weighted sums over pairs of a position at rest `x` and a position at a key time `y`.
#[derive(Debug, Clone, Copy, Default)]
struct PairSums {
    weight: f64,
    x: [f64; 3],
    y: [f64; 3],
    cross: [[f64; 3]; 3],
    squares: f64,
}

impl PairSums {
    fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.squares += other.squares;
        for a in 0..3 {
            self.x[a] += other.x[a];
            self.y[a] += other.y[a];
            for b in 0..3 {
                self.cross[a][b] += other.cross[a][b];
            }
        }
    }

    /// `min Σ w |R (x − x̄) − (y − ȳ)|²` over rotations: `Σ w |x − x̄|² + Σ w |y − ȳ|² − 2 λ`, with
    /// the largest eigenvalue `λ` of Davenport's matrix.
    fn error(&self) -> f64 {
        if self.weight <= 0.0 {
            return 0.0;
        }
        let mut s = self.cross;
        let mut spread = self.squares;
        for a in 0..3 {
            spread -= (self.x[a] * self.x[a] + self.y[a] * self.y[a]) / self.weight;
            for b in 0..3 {
                s[a][b] -= self.x[a] * self.y[b] / self.weight;
            }
        }
        let (a, b, c) = (s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]);
        let (d, e, f) = (s[0][1] + s[1][0], s[0][2] + s[2][0], s[1][2] + s[2][1]);
        let davenport = [
            [s[0][0] + s[1][1] + s[2][2], a, b, c],
            [a, s[0][0] - s[1][1] - s[2][2], d, e],
            [b, d, s[1][1] - s[0][0] - s[2][2], f],
            [c, e, f, s[2][2] - s[0][0] - s[1][1]],
        ];
        let largest = eigen(davenport).0.into_iter().fold(f64::NEG_INFINITY, f64::max);
        (spread - 2.0 * largest).max(0.0)
    }
}

impl Moments {
    fn of(points: &Trajectories, members: &[u32]) -> Self {
        let sums = |k: usize| {
            let mut sums = PairSums::default();
            for &point in members {
                let point = point as usize;
                let (x, y) = (points.rest[point], points.places(point)[k]);
                let weight = points.present(k, point);
                let mut one = PairSums {
                    weight,
                    x: x.map(|v| weight * v),
                    y: y.map(|v| weight * v),
                    ..PairSums::default()
                };
                for a in 0..3 {
                    one.squares += weight * (x[a] * x[a] + y[a] * y[a]);
                    for b in 0..3 {
                        one.cross[a][b] = weight * x[a] * y[b];
                    }
                }
                sums.add(&one);
            }
            sums
        };
        Self {
            num: members.len() as f64,
            at: (0..points.num_times()).map(sums).collect(),
            error: 0.0,
        }
        .with_error()
    }

    fn with_error(mut self) -> Self {
        self.error = self.at.iter().map(PairSums::error).fold(0.0, f64::max);
        self
    }

    fn with(&self, other: &Self) -> Self {
        let mut both = self.clone();
        both.num += other.num;
        for (own, others) in both.at.iter_mut().zip(&other.at) {
            own.add(others);
        }
        both.with_error()
    }
}

/// Two groups that could be joined. Ordered so that a heap yields the cheapest first.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MergeCandidate {
    cost: f64,
    groups: [usize; 2],
    versions: [u32; 2],
}

impl Eq for MergeCandidate {}

impl Ord for MergeCandidate {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        other.cost.total_cmp(&self.cost).then_with(|| other.groups.cmp(&self.groups))
    }
}

impl PartialOrd for MergeCandidate {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

#[derive(Debug)]
struct Merging {
    moments: Vec<Moments>,
    near: Vec<BTreeSet<usize>>,
    version: Vec<u32>,
    alive: Vec<bool>,
    joined: Vec<Vec<usize>>,
}

impl Merging {
    fn run(&mut self, misfit: f64, fragment: f64) {
        let mut heap = BinaryHeap::new();
        for a in 0..self.near.len() {
            heap.extend(self.near[a].range(a + 1..).map(|&b| self.pair(a, b)));
        }
        while let Some(MergeCandidate { cost, groups: [a, b], versions }) = heap.pop() {
            let current =
                self.alive[a] && self.alive[b] && versions == [self.version[a], self.version[b]];
            let small = self.moments[a].num.min(self.moments[b].num) < fragment;
            if !current || (cost > misfit && !small) {
                continue;
            }
            self.moments[a] = self.moments[a].with(&self.moments[b]);
            self.alive[b] = false;
            self.version[a] += 1;
            let members = std::mem::take(&mut self.joined[b]);
            self.joined[a].extend(members);
            let others = std::mem::take(&mut self.near[b]);
            for other in others {
                self.near[other].remove(&b);
                if other != a {
                    self.near[other].insert(a);
                    self.near[a].insert(other);
                }
            }
            heap.extend(self.near[a].iter().map(|&other| self.pair(a.min(other), a.max(other))));
        }
    }

    fn pair(&self, a: usize, b: usize) -> MergeCandidate {
        let (one, other) = (&self.moments[a], &self.moments[b]);
        let more = one.with(other).error - one.error - other.error;
        MergeCandidate {
            cost: (more.max(0.0) / one.num.min(other.num)).sqrt(),
            groups: [a, b],
            versions: [self.version[a], self.version[b]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three bars of 20 × 4 points in a row along x: one is static, one rotates about the first
    /// joint, one also rotates about the second.
    #[test]
    fn bars_between_joints_are_separate_parts() {
        let rest: Vec<[f64; 3]> = (0..240)
            .map(|i| {
                [0.05 * f64::from(i / 4) + 0.001, 0.05 * f64::from(i % 4), 0.01 * f64::from(i % 3)]
            })
            .collect();
        let rotate = |v: [f64; 3], pivot: [f64; 3], angle: f64| {
            let (sin, cos) = angle.sin_cos();
            let d = sub(v, pivot);
            [pivot[0] + cos * d[0] - sin * d[1], pivot[1] + sin * d[0] + cos * d[1], v[2]]
        };
        let moved = |(i, &x): (usize, &[f64; 3])| {
            [0.3, 0.8].map(|angle| {
                let x = if i >= 160 { rotate(x, [2.0, 0.075, 0.0], angle) } else { x };
                let x = if i >= 80 { rotate(x, [1.0, 0.075, 0.0], angle) } else { x };
                [x[0], x[1] + angle, x[2]]
            })
        };
        let points = Trajectories {
            weights: vec![1.0; rest.len()],
            moving: vec![true; rest.len()],
            presence: Vec::new(),
            moved: rest.iter().enumerate().flat_map(moved).collect(),
            rest,
        };
        let found = groups(&points, 3.0);
        assert_eq!(
            found.len(),
            3,
            "three bodies: {:?}",
            found.iter().map(Vec::len).collect::<Vec<_>>()
        );
        for members in &found {
            let bar = members[members.len() / 2] / 80;
            let own = members.iter().filter(|&&i| i / 80 == bar).count();
            assert!(own * 10 >= members.len() * 9, "one bar in each: {own} of {}", members.len());
        }
    }

    #[test]
    fn errors_of_rigid_motions_are_zero() {
        // A rotation by 90° about z and a step; the last point is displaced by `off` along z.
        let error = |off: f64| {
            let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.3, 0.1, 1.0]];
            let mut sums = PairSums::default();
            for (i, x) in points.into_iter().enumerate() {
                let stray = if i == 3 { off } else { 0.0 };
                let y = [2.0 - x[1], x[0] + 1.0, x[2] + stray];
                let mut one = PairSums { weight: 1.0, x, y, ..PairSums::default() };
                for a in 0..3 {
                    one.squares += x[a] * x[a] + y[a] * y[a];
                    for b in 0..3 {
                        one.cross[a][b] = x[a] * y[b];
                    }
                }
                sums.add(&one);
            }
            sums.error()
        };
        assert!(error(0.0) < 1e-12, "a rigid motion: {}", error(0.0));
        assert!(error(1.0) > 0.1, "not rigid: {}", error(1.0));
    }
}
