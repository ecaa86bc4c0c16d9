//! [`AnchorSet`]: the anchors of a cloud, and the membership of its points.

use rayon::prelude::*;

use crate::cylinder::{Hit, best_lines};
use crate::groups::mean_edge;
use crate::kdtree::KdTree;
use crate::points::{Coordinate, distance_squared, widen};
use crate::vec3::{Vec3, add, scale, sub};
use crate::{AnchorError, AnchorParams, BoundingSphere, Line, Lines, Neighborhoods, Radius};

/// Entry of [`AnchorSet::owners`] for a point that belongs to no anchor.
pub const NO_ANCHOR: u32 = u32::MAX;

/// Entry of [`AnchorSet::lines`] for an anchor that needed no line.
pub const NO_LINE: u32 = u32::MAX;

/// Anchors of one cloud (Eq. 7), in the order of their neighbourhoods; canonical if those were
/// built by [`Neighborhoods::build`].
#[derive(Clone, Debug, PartialEq)]
pub struct AnchorSet {
    /// Anchor positions, world units, `[n,3]` (Eq. 6).
    pub positions: Vec<[f64; 3]>,
    /// Point ids of each anchor's neighbourhood, `[n]`.
    pub members: Neighborhoods,
    /// Id of the retained line, `[n]`; [`NO_LINE`] for anchors that needed none.
    pub lines: Vec<u32>,
    /// Anchor of each point of the cloud, `[N]`; [`NO_ANCHOR`] for uncovered points. If
    /// neighbourhoods overlap, the nearest of the anchors of which the point is a member, ties to
    /// the lowest.
    pub owners: Vec<u32>,
    /// Cylinder radius δ used, world units. For [`Radius::Local`] the mean over the neighbourhoods
    /// of positive size.
    pub delta: f64,
    /// Number of uncovered points that are in no neighbourhood.
    pub num_ungrouped: usize,
    /// Number of uncovered points whose neighbourhoods were hit by no line.
    pub num_unhit: usize,
}

impl AnchorSet {
    /// Anchors of `points` `[N,3]`: one for every neighbourhood that fits into the cylinder of
    /// radius δ around some line.
    ///
    /// Of several such lines the one with the smallest maximum distance to the members is
    /// retained, ties to the lowest id. The anchor is the mean of the members weighted by their
    /// distances from that line (Eq. 6), the plain mean if those sum to less than 1e-12·δ. It lies
    /// in the convex hull of the members.
    ///
    /// δ is proportional to a mean distance: over all pairs in a neighbourhood, then over the
    /// neighbourhoods of positive size. Neighbourhoods of coincident points are left out. A
    /// neighbourhood of one point needs no line, nor does any with δ = 0 (all members coincide, and
    /// for [`Radius::Global`] those of all others too): it becomes an anchor at that position.
    ///
    /// A set without anchors is a valid result: every point is then uncovered.
    ///
    /// # Errors
    /// Empty cloud, coordinates that are not finite or beyond ±1e50, parameters out of range,
    /// neighbourhoods made for a different number of points.
    pub fn build<T: Coordinate>(
        points: &[[T; 3]],
        neighborhoods: &Neighborhoods,
        lines: &Lines,
        params: &AnchorParams,
    ) -> Result<Self, AnchorError> {
        params.validate()?;
        let points = widen(points)?;
        if points.len() != neighborhoods.num_points() {
            return Err(AnchorError::BadNeighborhoods {
                reason: format!(
                    "they refer to {} points, the cloud has {}",
                    neighborhoods.num_points(),
                    points.len()
                ),
            });
        }
        let (delta, deltas) = cylinder_radii(&points, neighborhoods, params);
        let hits = best_lines(&points, neighborhoods, &deltas, lines);
        let mut set = Self {
            positions: Vec::new(),
            members: Neighborhoods::empty(points.len()),
            lines: Vec::new(),
            owners: Vec::new(),
            delta,
            num_ungrouped: 0,
            num_unhit: 0,
        };
        for (i, (hit, delta)) in hits.iter().zip(&deltas).enumerate() {
            let members = neighborhoods.get(i);
            let position = match hit {
                Some(Hit { line, .. }) => {
                    let line = &lines.as_slice()[*line as usize];
                    weighted_centroid(&points, members, line, *delta)
                }
                None if *delta > 0.0 => continue,
                None => points[members[0] as usize],
            };
            set.positions.push(position);
            set.members.push(members);
            set.lines.push(hit.map_or(NO_LINE, |hit| hit.line));
        }
        set.assign_owners(&points, neighborhoods);
        Ok(set)
    }

    /// Anchors of one cloud: sphere, lines, neighbourhoods and anchors in one call.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn of<T: Coordinate>(
        points: &[[T; 3]],
        params: &AnchorParams,
    ) -> Result<Self, AnchorError> {
        params.validate()?;
        let sphere = BoundingSphere::of(points)?;
        let lines = Lines::sample(&sphere, params.num_lines, params.seed);
        let neighborhoods = Neighborhoods::build(points, None, params)?;
        Self::build(points, &neighborhoods, &lines, params)
    }

    /// Anchors of two clouds, such as a source and an edited copy, sampled with the same lines
    /// through the smallest sphere around both (supplement, Anchor Construction).
    ///
    /// # Errors
    /// As [`Self::build`], for either cloud.
    pub fn of_pair<T: Coordinate>(
        src: &[[T; 3]],
        edit: &[[T; 3]],
        params: &AnchorParams,
    ) -> Result<(Self, Self), AnchorError> {
        params.validate()?;
        let sphere = BoundingSphere::of_union(&[src, edit])?;
        let lines = Lines::sample(&sphere, params.num_lines, params.seed);
        let anchors = |points| {
            Self::build(points, &Neighborhoods::build(points, None, params)?, &lines, params)
        };
        Ok((anchors(src)?, anchors(edit)?))
    }

    /// Number of anchors, n.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no anchor.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Number of points that belong to no anchor.
    pub fn num_uncovered(&self) -> usize {
        self.num_ungrouped + self.num_unhit
    }

    /// [`Self::owners`] with every uncovered point assigned to the nearest anchor, ties to the
    /// lowest (supplement, Anchor Construction). `points` is the cloud from which the set was
    /// built.
    ///
    /// With an empty set every entry is [`NO_ANCHOR`].
    ///
    /// # Errors
    /// A number of points different from that of the cloud from which the set was built;
    /// coordinates that are not finite or beyond ±1e50.
    pub fn owners_or_nearest<T: Coordinate>(
        &self,
        points: &[[T; 3]],
    ) -> Result<Vec<u32>, AnchorError> {
        let points = widen(points)?;
        if points.len() != self.owners.len() {
            return Err(AnchorError::BadNeighborhoods {
                reason: format!(
                    "the anchors cover {} points, the cloud has {}",
                    self.owners.len(),
                    points.len()
                ),
            });
        }
        let tree = KdTree::new(&self.positions);
        let nearest = |(point, owner): (&Vec3, &u32)| {
            if *owner != NO_ANCHOR {
                return *owner;
            }
            let mut found = Vec::with_capacity(1);
            tree.nearest(point, 1, &mut found);
            found.first().map_or(NO_ANCHOR, |n| n.id)
        };
        Ok(points.par_iter().zip(&self.owners).with_min_len(1024).map(nearest).collect())
    }

    fn assign_owners(&mut self, points: &[Vec3], neighborhoods: &Neighborhoods) {
        let mut nearest = vec![(f64::INFINITY, NO_ANCHOR); points.len()];
        for (anchor, members) in self.members.iter().enumerate() {
            for id in members {
                let id = *id as usize;
                let distance2 = distance_squared(&points[id], &self.positions[anchor]);
                if distance2 < nearest[id].0 {
                    nearest[id] = (distance2, anchor as u32);
                }
            }
        }
        self.owners = nearest.into_iter().map(|(_, anchor)| anchor).collect();
        let mut grouped = vec![false; points.len()];
        for id in neighborhoods.indices() {
            grouped[*id as usize] = true;
        }
        self.num_ungrouped = grouped.iter().filter(|grouped| !**grouped).count();
        let uncovered = self.owners.iter().filter(|owner| **owner == NO_ANCHOR).count();
        self.num_unhit = uncovered - self.num_ungrouped;
    }
}

/// The reported δ, and δ of each neighbourhood (0 for those that need no line), world units.
fn cylinder_radii(
    points: &[Vec3],
    neighborhoods: &Neighborhoods,
    params: &AnchorParams,
) -> (f64, Vec<f64>) {
    let edges: Vec<f64> = (0..neighborhoods.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| mean_edge(points, neighborhoods.get(i)))
        .collect();
    let positive = edges.iter().filter(|edge| **edge > 0.0);
    let (count, sum) = positive.fold((0_usize, 0.0), |(count, sum), edge| (count + 1, sum + edge));
    let global = params.radius_factor * sum / count.max(1) as f64;
    let common = match params.radius {
        Radius::Global | Radius::Local => global,
        Radius::Fixed(delta) => delta,
    };
    let of_one = |(i, edge): (usize, &f64)| match params.radius {
        _ if neighborhoods.get(i).len() == 1 => 0.0,
        Radius::Local => params.radius_factor * edge,
        Radius::Global | Radius::Fixed(_) => common,
    };
    (common, edges.iter().enumerate().map(of_one).collect())
}

/// Eq. 6: the members' mean, weighted by distance from the line.
fn weighted_centroid(points: &[Vec3], members: &[u32], line: &Line, delta: f64) -> Vec3 {
    // Offsets from one member keep the result exact for coincident members.
    let base = points[members[0] as usize];
    let (mut total, mut weighted, mut plain) = (0.0, [0.0; 3], [0.0; 3]);
    for id in members {
        let point = &points[*id as usize];
        let (offset, weight) = (sub(point, &base), line.distance_squared(point).sqrt());
        total += weight;
        weighted = add(&weighted, &scale(&offset, weight));
        plain = add(&plain, &offset);
    }
    let offset = if total < 1e-12 * delta {
        scale(&plain, 1.0 / members.len() as f64)
    } else {
        scale(&weighted, 1.0 / total)
    };
    add(&base, &offset)
}
