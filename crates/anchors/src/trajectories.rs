//! Trajectories of points, and rigidity of their neighbourhoods.

use rayon::prelude::*;
use std::ops::Range;

use crate::kdtree::{KdTree, Neighbor};
use crate::median::median;
use crate::points::distance_squared;

/// Number of neighbours per point in [`RigidNeighbors`]: about two rings on a surface.
pub const NEIGHBORS: usize = 24;

/// The spacing is the distance of the neighbour of this rank over √2: on a surface about the
/// distance between points.
const SPACING_RANK: usize = 6;

/// Number of nearest neighbours per point whose changes of distance are pooled for the noise: these
/// move rigidly almost everywhere.
const NOISE_NEIGHBORS: usize = 8;

/// Maximum change of distance due to noise, in units of the pooled median: about three standard
/// deviations.
pub const NOISE_REACH: f64 = 3.0;

/// A point is an outlier if at most this share of its neighbourhood's weight moves with it.
/// Measured on scenes not used to choose it, geometric means of the end-point error against 0.3:
/// .97 (20 cases), .91 (goldens), .81 (articulated robots); no case was worse.
const MIN_SUPPORT: f64 = 0.15;

/// Lower bound of lengths in denominators; its square does not underflow.
const TINY: f64 = 1e-100;

/// Positions of N points at rest (a reference time) and at T other times, world frame and units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectories {
    /// Positions at rest, `[N,3]`.
    pub rest: Vec<[f64; 3]>,
    /// Positions at each other time, `[N,T,3]`: those of one point are adjacent.
    pub moved: Vec<[f64; 3]>,
    /// Presence of each point at each other time, 0 to 1, `[N,T]`; empty if all are always present.
    /// Positions of absent points are ignored.
    pub presence: Vec<f64>,
    /// Weights above 0, `[N]`.
    pub weights: Vec<f64>,
    /// Flags of the moving points, `[N]`. Only these determine the noise and the typical spacing: a
    /// static background has different noise and density.
    pub moving: Vec<bool>,
}

/// Neighbours at rest, and the agreement of each pair: 0 to 1, 1 if its distance is constant over
/// time.
#[derive(Clone, Debug)]
pub struct RigidNeighbors {
    near: Neighbors,
    /// Agreement of each pair, in the order of `near`.
    agreement: Vec<f64>,
    /// Local spacing: distance to the sixth neighbour divided by √2, world units, `[N]`.
    pub spacing: Vec<f64>,
    /// Noise of the trajectories: median of the largest change over time of the distance between
    /// close neighbours, world units.
    pub noise: f64,
    /// Change of distance, relative to the distance, that still counts as rigid.
    strain: f64,
}

/// The nearest others of every point, each list ascending by (distance, id).
///
/// Lists are stored in the order of a k-d tree: those of points that lie together are adjacent.
/// Distances are computed on demand, which saves two thirds of the memory.
#[derive(Clone, Debug)]
pub struct Neighbors {
    /// Ids of the neighbours, list by list.
    lists: Vec<u32>,
    per_point: usize,
    /// Point of each list.
    ids: Vec<u32>,
    /// List of each point.
    places: Vec<u32>,
    points: Vec<[f64; 3]>,
}

impl Neighbors {
    /// The `k` nearest others (all, if there are fewer) of every point of `points` `[N,3]`.
    pub fn of(points: &[[f64; 3]], k: usize) -> Self {
        let per_point = k.min(points.len().saturating_sub(1));
        let tree = KdTree::<3>::new(points);
        let ids = tree.ids().to_vec();
        let mut places = vec![0; ids.len()];
        for (place, id) in (0..).zip(&ids) {
            places[*id as usize] = place;
        }
        let lists = tree.all_nearest(per_point);
        Self { lists, per_point, ids, places, points: points.to_vec() }
    }

    /// Neighbours of point `i`, in ascending order of (distance, id).
    pub fn get(&self, i: usize) -> impl ExactSizeIterator<Item = Neighbor> + Clone + '_ {
        let point = &self.points[i];
        self.lists[self.range(i)].iter().map(|&id| {
            let distance_squared = distance_squared(point, &self.points[id as usize]);
            Neighbor { distance_squared, id }
        })
    }

    /// Range of the list of point `i`.
    fn range(&self, i: usize) -> Range<usize> {
        let first = self.places[i] as usize * self.per_point;
        first..first + self.per_point
    }

    /// Local spacing: distance of each point to its sixth neighbour (the last, if there are fewer)
    /// divided by √2, unit of the points, `[N]`; 0 without neighbours. On a surface this is about
    /// the distance between adjacent points.
    pub fn spacing(&self) -> Vec<f64> {
        let rank = SPACING_RANK.min(self.per_point);
        let of = |i: usize| {
            let last = rank.checked_sub(1).and_then(|last| self.get(i).nth(last));
            last.map_or(0.0, |n| n.distance_squared.sqrt()) / std::f64::consts::SQRT_2
        };
        (0..self.points.len()).into_par_iter().with_min_len(1024).map(of).collect()
    }
}

impl Trajectories {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Number of times other than rest, T.
    pub fn num_times(&self) -> usize {
        self.moved.len().checked_div(self.rest.len()).unwrap_or(0)
    }

    /// Positions of point `i` at the other times, world units, `[T,3]`.
    pub fn places(&self, i: usize) -> &[[f64; 3]] {
        let times = self.num_times();
        &self.moved[i * times..(i + 1) * times]
    }

    /// Presence of point `i` at time `k`, 0 to 1.
    pub fn present(&self, k: usize, i: usize) -> f64 {
        if self.presence.is_empty() { 1.0 } else { self.presence[i * self.num_times() + k] }
    }

    /// Maximum over time of the change of the distance between `a` and `b`, times the presence of
    /// both, world units. `rest` is the distance at rest.
    fn deviation(&self, a: usize, b: usize, rest: f64) -> f64 {
        let squares =
            self.places(a).iter().zip(self.places(b)).map(|(x, y)| distance_squared(x, y));
        if self.presence.is_empty() {
            // Square roots and differences are monotonic, after rounding too.
            let extremes = |(low, high): (f64, f64), d: f64| (low.min(d), high.max(d));
            let (low, high) = squares.fold((f64::INFINITY, f64::NEG_INFINITY), extremes);
            return 0.0_f64.max(high.sqrt() - rest).max(rest - low.sqrt());
        }
        let changes = squares.enumerate().map(|(k, squared)| {
            (squared.sqrt() - rest).abs() * self.present(k, a).min(self.present(k, b))
        });
        changes.fold(0.0, f64::max)
    }
}

impl RigidNeighbors {
    /// The 24 nearest neighbours of every point, and their agreement
    /// `exp(−½ (Δ / (3ν + strain·d))²)`, where d is the distance at rest, Δ its largest change over
    /// time and ν the noise. `strain` is the relative change of distance of a soft body that still
    /// counts as rigid.
    ///
    /// # Panics
    /// If `moving` or `presence` is too short for the number of points.
    pub fn of(points: &Trajectories, strain: f64) -> Self {
        let near = Neighbors::of(&points.rest, NEIGHBORS);
        let spacing = near.spacing();
        let per_point = near.per_point.max(1);
        // The agreement first contains the deviations.
        let mut agreement = vec![0.0; near.lists.len()];
        let lists = agreement.par_chunks_mut(per_point).zip(&near.ids).with_min_len(256);
        lists.for_each(|(own, &i)| {
            for (value, n) in own.iter_mut().zip(near.get(i as usize)) {
                let rest = n.distance_squared.sqrt();
                *value = points.deviation(i as usize, n.id as usize, rest);
            }
        });
        let moving = near.ids.iter().zip(agreement.chunks(per_point));
        let close = moving
            .filter(|(i, _)| points.moving[**i as usize])
            .flat_map(|(_, deviations)| deviations.iter().take(NOISE_NEIGHBORS).copied());
        let noise = median(&mut close.collect::<Vec<f64>>());
        let lists = agreement.par_chunks_mut(per_point).zip(&near.ids).with_min_len(256);
        lists.for_each(|(own, &i)| {
            for (value, n) in own.iter_mut().zip(near.get(i as usize)) {
                *value = agreement_of(*value, n.distance_squared.sqrt(), noise, strain);
            }
        });
        Self { near, agreement, spacing, noise, strain }
    }

    /// The points in an order in which those that lie together mostly follow each other, `[N]`.
    pub(crate) fn order(&self) -> &[u32] {
        &self.near.ids
    }

    /// The up to [`NEIGHBORS`] nearest points to point `i`, in ascending order of (distance, id),
    /// each with its agreement, 0 to 1: 1 if the distance is constant, near 0 if it changes by much
    /// more than noise and strain.
    ///
    /// # Panics
    /// If `i` is out of range.
    pub fn get(&self, i: usize) -> impl ExactSizeIterator<Item = (Neighbor, f64)> + '_ {
        let own = &self.agreement[self.near.range(i)];
        self.near.get(i).zip(own.iter().copied())
    }

    /// Agreement of any two points `a` and `b`, 0 to 1. `points` are those from which this was
    /// built.
    pub fn between(&self, points: &Trajectories, a: usize, b: usize) -> f64 {
        let rest = distance_squared(&points.rest[a], &points.rest[b]).sqrt();
        agreement_of(points.deviation(a, b, rest), rest, self.noise, self.strain)
    }

    /// Weight of a neighbour of point `i`: the neighbour's own weight times
    /// `exp(−½ (distance / 2 spacing)²)`.
    pub fn nearness(&self, points: &Trajectories, i: usize, neighbor: Neighbor) -> f64 {
        let reach = (2.0 * self.spacing[i]).max(TINY);
        let fall = (-0.5 * neighbor.distance_squared / (reach * reach)).exp();
        points.weights[neighbor.id as usize] * fall
    }

    /// Median spacing of the moving points, world units.
    pub fn typical_spacing(&self, points: &Trajectories) -> f64 {
        let moving = self.spacing.iter().zip(&points.moving).filter(|(_, moving)| **moving);
        median(&mut moving.map(|(spacing, _)| *spacing).collect::<Vec<f64>>())
    }

    /// Points that agree with 15 % or less of their neighbourhood, weighted by [`Self::nearness`],
    /// `[N]`. A point without neighbours is not an outlier.
    pub fn outliers(&self, points: &Trajectories) -> Vec<bool> {
        (0..points.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let (mut kept, mut all) = (0.0, 0.0);
                for (neighbor, agreement) in self.get(i) {
                    let nearness = self.nearness(points, i, neighbor);
                    kept += nearness * agreement;
                    all += nearness;
                }
                all > 0.0 && kept <= MIN_SUPPORT * all
            })
            .collect()
    }
}

fn agreement_of(deviation: f64, length: f64, noise: f64, strain: f64) -> f64 {
    let stiff = NOISE_REACH * noise + strain * length;
    if stiff > 0.0 { (-0.5 * (deviation / stiff).powi(2)).exp() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vec3::Vec3;

    /// Two plates of 6 × 6 points, one of which rises; a point between them that moves
    /// independently.
    fn plates() -> Trajectories {
        let mut rest: Vec<Vec3> = (0..72)
            .map(|i| {
                let (plate, place) = (i / 36, i % 36);
                [f64::from(place % 6), f64::from(place / 6), 1.5 * f64::from(plate)]
            })
            .collect();
        rest.push([2.4, 2.6, 0.7]);
        let lift = |(i, x): (usize, &Vec3)| match i {
            0..36 => *x,
            36..72 => [x[0], x[1], x[2] + 3.0],
            _ => [x[0] + 5.0, x[1] - 4.0, x[2]],
        };
        Trajectories {
            moved: rest.iter().enumerate().map(lift).collect(),
            presence: Vec::new(),
            weights: vec![1.0; rest.len()],
            moving: vec![true; rest.len()],
            rest,
        }
    }

    #[test]
    fn neighbors_agree_within_a_plate_and_not_across() {
        let points = plates();
        let rigid = RigidNeighbors::of(&points, 0.04);
        assert!(rigid.noise < 1e-12, "no noise: {}", rigid.noise);
        for i in 0..72 {
            for (n, agreement) in rigid.get(i) {
                let same = n.id < 72 && (n.id / 36) as usize == i / 36;
                assert_eq!(agreement > 0.5, same, "{i} and {}: {agreement}", n.id);
            }
        }
        let outliers = rigid.outliers(&points);
        assert!(outliers[72], "the outlier");
        assert!(!outliers[..72].iter().any(|o| *o), "both plates");
        assert!(rigid.between(&points, 0, 35) > 0.99, "far ends of a plate");
        assert!(rigid.between(&points, 0, 36) < 0.01, "points of different plates");
    }

    #[test]
    fn positions_of_absent_points_are_ignored() {
        let mut points = plates();
        points.presence = (0..73).map(|i| if i >= 36 { 0.0 } else { 1.0 }).collect();
        let rigid = RigidNeighbors::of(&points, 0.04);
        assert!(rigid.between(&points, 0, 36) > 0.99, "changes while a point is absent");
    }

    #[test]
    fn the_spacing_equals_the_lattice_constant() {
        let rigid = RigidNeighbors::of(&plates(), 0.04);
        // The sixth neighbour of an inner point lies on a diagonal.
        let inner = rigid.spacing[14];
        assert!((0.9..=1.1).contains(&inner), "{inner}");
    }

    #[test]
    fn empty_clouds_and_single_points_have_results() {
        for count in [0, 1] {
            let points = Trajectories {
                rest: vec![[0.0; 3]; count],
                moved: vec![[0.0; 3]; count],
                weights: vec![1.0; count],
                moving: vec![true; count],
                presence: Vec::new(),
            };
            let rigid = RigidNeighbors::of(&points, 0.04);
            assert!(rigid.outliers(&points).iter().all(|o| !o), "no neighbourhood, no outlier");
            assert_eq!(rigid.spacing, vec![0.0; count], "no distance");
        }
    }
}
