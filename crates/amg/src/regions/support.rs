//! The sources each edited splat finally moves with.

use super::consensus::Consensus;
use super::cubes::Cube;
use super::numeric::TINY;
use super::region_motion::{Path, RegionMotion};
use super::source::Regions;
use crate::rigid::{dot, norm, sub};
use crate::row_index::index;
use anchors::{KdTree, Neighbor};
use gs_core::Real;

/// Regions whose splats are considered: enough for a choice, few enough to stay near, unless they
/// have but a splat each.
const MIN_REGIONS: usize = 8;
const MAX_REGIONS: usize = 24;

/// Regions looked at for a splat far from all of them.
const FAR_REGIONS: usize = 256;

/// Sources of a support agree better than regions that count as one motion: share of the tolerance.
const SAME: f32 = 0.7;

/// Width of the weights, in spacings of the regions, and its growth with the squared distance of
/// the nearest source.
const KERNEL: f64 = 1.8;
const KERNEL_GROWTH: f64 = 0.09;

/// Spread of a support across its surface, as a share of the whole, at which it is no direction to
/// be centred in any more; and the factors on weights that centring may ask for.
const RIDGE: f64 = 0.15;
const CENTRING: [f64; 2] = [0.1, 4.0];

/// Regions compared at once.
const CHUNK: usize = 32;

/// Weights below this are left out: rounding.
const NEGLIGIBLE: f64 = 1e-9;

/// What is kept from splat to splat, so that nothing is allocated for each.
#[derive(Default)]
pub(super) struct Scratch {
    apart: Vec<f32>,
    path: Path,
    points: Vec<(f64, u32)>,
    first_of_region: Vec<(f64, u32)>,
    entries: Vec<(u32, f64)>,
    /// Regions around the one that was last asked for far splats.
    around: Option<(u32, Vec<Neighbor>)>,
    ids: Vec<u32>,
}

/// Finds supports.
pub(super) struct Supports<'a> {
    pub(super) regions: &'a Regions,
    pub(super) motion: &'a RegionMotion,
    pub(super) spacing: &'a [f64],
    pub(super) tolerance: f32,
    pub(super) sources_per_row: usize,
    pub(super) consensus: Consensus<'a>,
    /// The regions that are no outliers, and their centroids.
    pub(super) kept: &'a [usize],
    pub(super) tree: &'a KdTree<3>,
}

impl Supports<'_> {
    /// Sources around a splat at `x` in `cube` that move like region `own`, and weights.
    pub(super) fn near(
        &self,
        x: [f64; 3],
        cube: &Cube,
        own: u32,
        scratch: &mut Scratch,
    ) -> Vec<(u32, f32)> {
        let Scratch { apart, path, points, first_of_region, entries, .. } = scratch;
        self.motion.path(own as usize, x.map(Real::as_f32), path);
        points.clear();
        first_of_region.clear();
        let enough = |regions: usize, points: usize| {
            (regions >= MAX_REGIONS && points >= self.sources_per_row)
                || (regions >= MIN_REGIONS && points >= 4 * self.sources_per_row)
        };
        let limit = (SAME * self.tolerance).powi(2);
        let mut add = |region: u32| {
            let mut nearest = (f64::INFINITY, 0);
            for &p in self.regions.members(region as usize) {
                let d = sub(self.regions.means[p as usize], x);
                let squared = dot(d, d);
                points.push((squared, p));
                nearest = if squared < nearest.0 { (squared, p) } else { nearest };
            }
            first_of_region.push(nearest);
            enough(first_of_region.len(), points.len())
        };
        let mut done = false;
        for some in cube.regions.chunks(CHUNK) {
            self.motion.apart(path, some, apart);
            let mut same = some.iter().zip(&*apart).filter(|(_, squared)| **squared <= limit);
            done = same.any(|(&region, _)| add(region));
            if done {
                break;
            }
        }
        if !done && !cube.regions.contains(&own) {
            add(own);
        }
        let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        // Half of them as near as possible, for the translation; the other half spread out, for the
        // rotation.
        let half = self.sources_per_row.div_ceil(2);
        let near = half.max(self.sources_per_row.saturating_sub(first_of_region.len()));
        if points.len() > near {
            points.select_nth_unstable_by(near, order);
            points.truncate(near);
        }
        points.sort_unstable_by(order);
        first_of_region.retain(|p| !points.contains(p));
        first_of_region.sort_unstable_by(order);
        first_of_region.truncate(self.sources_per_row.saturating_sub(points.len()));
        points.extend_from_slice(first_of_region);
        let h = self.spacing[own as usize];
        let nearest = points[0].0;
        let width = (KERNEL * h).powi(2) + KERNEL_GROWTH * nearest;
        let width = width.max(TINY * TINY);
        let weigh = |&(squared, p): &(f64, u32)| {
            (p, (-0.5 * (squared - nearest) / width).exp() * self.regions.weights[p as usize])
        };
        entries.clear();
        entries.extend(points.iter().map(weigh).filter(|(_, weight)| *weight > NEGLIGIBLE));
        // Where nothing moves, nothing can disagree.
        if !entries
            .iter()
            .all(|entry| self.motion.still[self.regions.cells.owners[entry.0 as usize] as usize])
        {
            self.consensus.reweigh(entries);
            self.centre(entries, x);
        }
        entries.iter().map(|&(p, w)| (index(self.regions.ids[p as usize]), w.as_f32())).collect()
    }

    /// Tilts the weights so that their centroid lies beside `x`, as in local linear regression:
    /// what a stretching or bending part does more of with every step aside then does no harm, and
    /// supports may be wide. Along the normal, across which supports have no spread, the rigid
    /// motion carries the offset.
    fn centre(&self, entries: &mut [(u32, f64)], x: [f64; 3]) {
        let total: f64 = entries.iter().map(|entry| entry.1).sum();
        let place = |point: u32| self.regions.means[point as usize];
        let mut centroid = [0.0; 3];
        for &(point, weight) in &*entries {
            for (c, p) in centroid.iter_mut().zip(place(point)) {
                *c += weight / total * p;
            }
        }
        let mut covariance = [[0.0; 3]; 3];
        for &(point, weight) in &*entries {
            let d = sub(place(point), centroid);
            for (row, a) in covariance.iter_mut().zip(d) {
                for (c, b) in row.iter_mut().zip(d) {
                    *c += weight / total * a * b;
                }
            }
        }
        let ridge = RIDGE * (covariance[0][0] + covariance[1][1] + covariance[2][2]);
        if ridge.is_nan() || ridge <= 0.0 {
            return;
        }
        // C (C + ridge)⁻² applied to where the splat lies aside.
        let mut ridged = covariance;
        for (i, row) in ridged.iter_mut().enumerate() {
            row[i] += ridge;
        }
        let inverse = inverse(ridged);
        let apply = |m: &[[f64; 3]; 3], v: [f64; 3]| m.map(|row| dot(row, v));
        let tilt = apply(&covariance, apply(&inverse, apply(&inverse, sub(x, centroid))));
        for (point, weight) in entries {
            let factor = 1.0 + dot(tilt, sub(place(*point), centroid));
            *weight *= factor.clamp(CENTRING[0], CENTRING[1]);
        }
    }

    /// Sources for a splat far from all of them that hangs on one which moves with region `own`:
    /// the wider the lever, the wider the support, as far as it moves as one.
    pub(super) fn far(&self, x: [f64; 3], own: u32, scratch: &mut Scratch) -> Vec<(u32, f32)> {
        let Scratch { apart, path, around, ids, .. } = scratch;
        let centre = self.regions.centroids.rest[own as usize];
        let lever = norm(sub(x, centre));
        // Splats of one piece ask for one region.
        let (asked, near) = around.get_or_insert_with(|| (u32::MAX, Vec::new()));
        if *asked != own {
            self.tree.nearest(&centre, FAR_REGIONS, near);
            *asked = own;
        }
        let reach = (0.5 * lever).max(2.0 * self.spacing[own as usize]);
        let tolerance = (f64::from(self.tolerance) + 0.1 * lever).as_f32();
        self.motion.path(own as usize, x.map(Real::as_f32), path);
        ids.clear();
        ids.extend(near.iter().map(|n| index(self.kept[n.id as usize])));
        self.motion.apart(path, ids, apart);
        let mut same = Vec::new();
        for ((n, &region), &squared) in near.iter().zip(&*ids).zip(&*apart) {
            if n.distance_squared.sqrt() > reach && same.len() >= self.sources_per_row {
                break;
            }
            if squared <= tolerance * tolerance {
                same.push(region);
            }
        }
        if !same.contains(&own) {
            same.insert(0, own);
        }
        let count = same.len().min(self.sources_per_row);
        (0..count)
            .map(|i| {
                let members = self.regions.members(same[i * same.len() / count] as usize);
                let point = members[members.len() / 2] as usize;
                (index(self.regions.ids[point]), self.regions.weights[point].as_f32())
            })
            .collect()
    }
}

/// Of a symmetric matrix that has one.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |i: usize, j: usize| {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        let (c, d) = ((j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum::<f64>();
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant))
}
