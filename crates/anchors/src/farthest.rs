//! Anchors by farthest-point sampling, a baseline without lines.

use std::ops::Range;

use crate::anchor_set::NO_LINE;
use crate::points::{Coordinate, distance_squared, id_from_rank, widen};
use crate::vec3::Vec3;
use crate::{AnchorError, AnchorSet, Neighborhoods};

/// Points of a box that are updated together.
const BUCKET: usize = 32;

/// Neighbouring points, and the one among them that is farthest from all anchors so far.
struct Bucket {
    /// Range of its points in [`Sampling::order`].
    points: Range<usize>,
    low: Vec3,
    high: Vec3,
    farthest: Candidate,
}

#[derive(Clone, Copy)]
struct Candidate {
    /// Squared distance to the nearest anchor.
    distance2: f64,
    rank: u32,
}

impl Candidate {
    fn beats(self, other: Self) -> bool {
        self.distance2 > other.distance2
            || (self.distance2 >= other.distance2 && self.rank < other.rank)
    }
}

/// Squared distances to the anchors so far; points in lexicographic rank, so that the input's order
/// does not matter.
struct Sampling<'p> {
    ranked: &'p [Vec3],
    order: Vec<u32>,
    buckets: Vec<Bucket>,
    /// Squared distance to the nearest anchor, and its id, by rank.
    nearest: Vec<(f64, u32)>,
}

impl AnchorSet {
    /// Anchors at up to `count` of the `points` `[N,3]`, world units: each is the point farthest
    /// from the anchors before it. The first is the farthest from the cloud's mean. Every point
    /// belongs to its nearest anchor, ties to the earlier one, so that no point is uncovered. There
    /// are fewer anchors if the cloud has fewer distinct points. [`AnchorSet::delta`] is the
    /// covering radius: the largest distance of a point from its anchor.
    ///
    /// Outliers are far from all other points and therefore become anchors first, unlike with lines
    /// and cylinders.
    ///
    /// # Errors
    /// Empty cloud, coordinates that are not finite or beyond ±1e50, `count` of zero.
    pub fn farthest<T: Coordinate>(points: &[[T; 3]], count: usize) -> Result<Self, AnchorError> {
        if count == 0 {
            let expected = "at least 1";
            return Err(AnchorError::BadParam { name: "count", value: 0.0, expected });
        }
        let points = widen(points)?;
        let id_from_rank = id_from_rank(&points);
        let ranked: Vec<Vec3> = id_from_rank.iter().map(|&id| points[id as usize]).collect();
        let mut sampling = Sampling::new(&ranked);
        let mut next = sampling.farthest_from_mean();
        let mut anchors: Vec<u32> = Vec::new();
        let delta2 = loop {
            sampling.add(next, anchors.len() as u32);
            anchors.push(next);
            let found = sampling.farthest();
            if anchors.len() == count || found.distance2 <= 0.0 {
                break found.distance2;
            }
            next = found.rank;
        };
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); anchors.len()];
        let mut owners = vec![0; points.len()];
        for (rank, &(_, anchor)) in sampling.nearest.iter().enumerate() {
            members[anchor as usize].push(id_from_rank[rank]);
            owners[id_from_rank[rank] as usize] = anchor;
        }
        let mut neighborhoods = Neighborhoods::empty(points.len());
        for members in &members {
            neighborhoods.push(members);
        }
        Ok(Self {
            positions: anchors.iter().map(|&rank| ranked[rank as usize]).collect(),
            members: neighborhoods,
            lines: vec![NO_LINE; anchors.len()],
            owners,
            delta: delta2.sqrt(),
            num_ungrouped: 0,
            num_unhit: 0,
        })
    }
}

impl<'p> Sampling<'p> {
    fn new(ranked: &'p [Vec3]) -> Self {
        let mut sampling = Self {
            ranked,
            order: (0..ranked.len() as u32).collect(),
            buckets: Vec::new(),
            nearest: vec![(f64::INFINITY, 0); ranked.len()],
        };
        sampling.split(0..ranked.len());
        sampling
    }

    /// Halves a range of `order` along its longest side until it is small.
    fn split(&mut self, range: Range<usize>) {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for &rank in &self.order[range.clone()] {
            for axis in 0..3 {
                low[axis] = low[axis].min(self.ranked[rank as usize][axis]);
                high[axis] = high[axis].max(self.ranked[rank as usize][axis]);
            }
        }
        if range.len() <= BUCKET {
            let farthest = Candidate { distance2: f64::INFINITY, rank: self.order[range.start] };
            self.buckets.push(Bucket { points: range, low, high, farthest });
            return;
        }
        let side = |axis: usize| high[axis] - low[axis];
        let axis = (1..3).fold(0, |best, axis| if side(axis) > side(best) { axis } else { best });
        let middle = range.len() / 2;
        let ranked = self.ranked;
        self.order[range.clone()].select_nth_unstable_by(middle, |&p, &q| {
            let (x, y) = (ranked[p as usize][axis], ranked[q as usize][axis]);
            x.total_cmp(&y).then(p.cmp(&q))
        });
        self.split(range.start..range.start + middle);
        self.split(range.start + middle..range.end);
    }

    fn farthest_from_mean(&self) -> u32 {
        let mut mean = [0.0; 3];
        for point in self.ranked {
            for axis in 0..3 {
                mean[axis] += point[axis] / self.ranked.len() as f64;
            }
        }
        let mut best = Candidate { distance2: f64::NEG_INFINITY, rank: 0 };
        for (point, rank) in self.ranked.iter().zip(0_u32..) {
            let candidate = Candidate { distance2: distance_squared(point, &mean), rank };
            if candidate.beats(best) {
                best = candidate;
            }
        }
        best.rank
    }

    /// Shortens distances to those from a new anchor. Boxes all of whose points are nearer to
    /// earlier anchors are skipped: the bound is computed by the same operations as the distances
    /// and never exceeds them.
    fn add(&mut self, rank: u32, anchor: u32) {
        let point = self.ranked[rank as usize];
        for bucket in &mut self.buckets {
            let inside: Vec3 =
                std::array::from_fn(|axis| point[axis].clamp(bucket.low[axis], bucket.high[axis]));
            if distance_squared(&inside, &point) >= bucket.farthest.distance2 {
                continue;
            }
            let mut farthest = Candidate { distance2: f64::NEG_INFINITY, rank: 0 };
            for &rank in &self.order[bucket.points.clone()] {
                let nearest = &mut self.nearest[rank as usize];
                let distance2 = distance_squared(&self.ranked[rank as usize], &point);
                if distance2 < nearest.0 {
                    *nearest = (distance2, anchor);
                }
                let candidate = Candidate { distance2: nearest.0, rank };
                if candidate.beats(farthest) {
                    farthest = candidate;
                }
            }
            bucket.farthest = farthest;
        }
    }

    fn farthest(&self) -> Candidate {
        let none = Candidate { distance2: f64::NEG_INFINITY, rank: u32::MAX };
        self.buckets.iter().fold(none, |best, bucket| {
            if bucket.farthest.beats(best) { bucket.farthest } else { best }
        })
    }
}
