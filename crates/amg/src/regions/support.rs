//! Support of each edited splat: the source splats whose motion it takes, and their weights.

use super::consensus::Consensus;
use super::cubes::Cube;
use super::numeric::TINY;
use super::region_motion::{Path, RegionMotion};
use super::region_tree::RegionTree;
use super::source::Regions;
use crate::rigid::{dot, norm, sub};
use crate::row_index::index;
use anchors::Neighbor;
use gs_core::Real;
use std::cmp::Ordering;

/// Regions whose splats are candidates for a support: at least [`MIN_REGIONS`], and at most
/// [`MAX_REGIONS`] if these contain few splats each.
const MIN_REGIONS: usize = 8;
const MAX_REGIONS: usize = 24;

/// Number of candidate regions of a splat that is far from all regions.
const FAR_REGIONS: usize = 256;

/// Maximum difference between the motion of a splat's region and that of a region in its support,
/// as a share of [`Supports::tolerance`]; far splats use the full tolerance.
const NEAR_TOLERANCE: f32 = 0.7;

/// Width of the weights over distance, in spacings of the regions, and its growth with the squared
/// distance of the nearest source.
const KERNEL: f64 = 1.8;
const KERNEL_GROWTH: f64 = 0.09;

/// Ridge of the local linear regression, as a share of the trace of the covariance: directions in
/// which a support has a smaller extent are not centred.
const RIDGE: f64 = 0.15;

/// Minimum and maximum factor by which centring changes weights.
const CENTRING: [f64; 2] = [0.1, 4.0];

/// Number of regions per call of the vectorised comparison.
const CHUNK: usize = 8;

/// Smaller weights do not change a fit beyond rounding and are omitted.
const NEGLIGIBLE: f64 = 1e-9;

/// Buffers reused from splat to splat.
#[derive(Default)]
pub(super) struct SupportScratch {
    deviations: Vec<f32>,
    path: Path,
    /// Squared distance and id of the nearest candidate points.
    points: Vec<(f64, u32)>,
    nearest_of_region: Vec<(f64, u32)>,
    entries: Vec<(u32, f64)>,
    /// Last region whose neighbours were searched for far splats, and these neighbours.
    around: Option<(u32, Vec<Neighbor>)>,
    ids: Vec<u32>,
}

/// Input of the search for supports.
pub(super) struct Supports<'a> {
    pub(super) regions: &'a Regions,
    pub(super) motion: &'a RegionMotion,
    /// Spacing of the regions, world units, `[R]`.
    pub(super) spacing: &'a [f64],
    /// Largest difference between motions in a support, world units.
    pub(super) tolerance: f32,
    pub(super) sources_per_row: usize,
    pub(super) consensus: Consensus<'a>,
    pub(super) tree: &'a RegionTree,
}

impl Supports<'_> {
    /// Source rows around a splat at `x` in `cube` that move with region `own`, and their weights.
    pub(super) fn near(
        &self,
        x: [f64; 3],
        cube: &Cube,
        own: u32,
        scratch: &mut SupportScratch,
    ) -> Vec<(u32, f32)> {
        self.collect_points(x, cube, own, scratch);
        self.select_points(scratch);
        let SupportScratch { points, entries, .. } = scratch;
        let h = self.spacing[own as usize];
        let nearest = points[0].0;
        let width = (KERNEL * h).powi(2) + KERNEL_GROWTH * nearest;
        let width = width.max(TINY * TINY);
        let weigh = |&(squared, p): &(f64, u32)| {
            (p, (-0.5 * (squared - nearest) / width).exp() * self.regions.weights[p as usize])
        };
        entries.clear();
        entries.extend(points.iter().map(weigh).filter(|(_, weight)| *weight > NEGLIGIBLE));
        let is_still = |&(p, _): &(u32, f64)| {
            self.motion.still[self.regions.cells.owners[p as usize] as usize]
        };
        // Static sources agree by definition.
        if !entries.iter().all(is_still) {
            self.consensus.reweight(entries);
            self.centre(entries, x);
        }
        entries.iter().map(|&(p, w)| (index(self.regions.ids[p as usize]), w.as_f32())).collect()
    }

    /// Collects the points of the regions of `cube` that move with region `own`, nearest regions
    /// first, until there are enough: of all these points, at least the `sources_per_row` nearest;
    /// and the nearest point of each region.
    fn collect_points(&self, x: [f64; 3], cube: &Cube, own: u32, scratch: &mut SupportScratch) {
        let SupportScratch { deviations, path, points, nearest_of_region, .. } = scratch;
        self.motion.path(own as usize, x.map(Real::as_f32), path);
        points.clear();
        nearest_of_region.clear();
        let enough = |regions: usize, points: usize| {
            (regions >= MAX_REGIONS && points >= self.sources_per_row)
                || (regions >= MIN_REGIONS && points >= 4 * self.sources_per_row)
        };
        let limit = (NEAR_TOLERANCE * self.tolerance).powi(2);
        let (mut count, mut reach) = (0, f64::INFINITY);
        let mut add = |region: u32| {
            let mut nearest = (f64::INFINITY, 0);
            let members = self.regions.members(region as usize);
            for (&p, mean) in members.iter().zip(self.regions.member_means(region as usize)) {
                let d = sub(*mean, x);
                let squared = dot(d, d);
                nearest = if squared < nearest.0 { (squared, p) } else { nearest };
                if squared <= reach {
                    points.push((squared, p));
                }
            }
            nearest_of_region.push(nearest);
            count += members.len();
            if points.len() >= 2 * self.sources_per_row {
                let last = self.sources_per_row - 1;
                reach = points.select_nth_unstable_by(last, order).1.0;
                points.truncate(self.sources_per_row);
            }
            enough(nearest_of_region.len(), count)
        };
        for regions in cube.regions.chunks(CHUNK) {
            self.motion.max_squared_distances(path, regions, deviations);
            let mut same = regions.iter().zip(&*deviations).filter(|(_, d)| **d <= limit);
            if same.any(|(&region, _)| add(region)) {
                return;
            }
        }
        if !cube.regions.contains(&own) {
            add(own);
        }
    }

    /// Reduces the collected points to a support: one half as near as possible, for the
    /// translation; the other half one point per region, spread out, for the rotation.
    fn select_points(&self, scratch: &mut SupportScratch) {
        let SupportScratch { points, nearest_of_region, .. } = scratch;
        let half = self.sources_per_row.div_ceil(2);
        let near = half.max(self.sources_per_row.saturating_sub(nearest_of_region.len()));
        if points.len() > near {
            points.select_nth_unstable_by(near, order);
            points.truncate(near);
        }
        points.sort_unstable_by(order);
        nearest_of_region.retain(|p| !points.contains(p));
        nearest_of_region.sort_unstable_by(order);
        nearest_of_region.truncate(self.sources_per_row.saturating_sub(points.len()));
        points.extend_from_slice(nearest_of_region);
    }

    /// Tilts the weights so that their centroid approaches `x`, as in local linear regression.
    /// Motion that varies linearly over a stretching or bending part then cancels, and supports may
    /// be wide. Along the normal, in which supports have no extent, the rigid motion accounts for
    /// the offset.
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
        // C (C + ridge)⁻² times the displacement of the splat from the centroid.
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

    /// Sources for a splat at `x` far from all regions that follows region `own`. The support grows
    /// with the lever arm, as far as the regions share the motion.
    pub(super) fn far(
        &self,
        x: [f64; 3],
        own: u32,
        scratch: &mut SupportScratch,
    ) -> Vec<(u32, f32)> {
        let SupportScratch { deviations, path, around, ids, .. } = scratch;
        let centre = self.regions.centroids.rest[own as usize];
        let lever = norm(sub(x, centre));
        // The splats of one piece mostly follow one region.
        let (region, near) = around.get_or_insert_with(|| (u32::MAX, Vec::new()));
        if *region != own {
            self.tree.nearest(&centre, FAR_REGIONS, near);
            *region = own;
        }
        let reach = (0.5 * lever).max(2.0 * self.spacing[own as usize]);
        let tolerance = (f64::from(self.tolerance) + 0.1 * lever).as_f32();
        self.motion.path(own as usize, x.map(Real::as_f32), path);
        ids.clear();
        ids.extend(near.iter().map(|n| n.id));
        self.motion.max_squared_distances(path, ids, deviations);
        let mut same = Vec::new();
        for (n, &squared) in near.iter().zip(&*deviations) {
            if n.distance_squared.sqrt() > reach && same.len() >= self.sources_per_row {
                break;
            }
            if squared <= tolerance * tolerance {
                same.push(n.id);
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

fn order(a: &(f64, u32), b: &(f64, u32)) -> Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

/// Inverse of a regular symmetric matrix.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |i: usize, j: usize| {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        let (c, d) = ((j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum::<f64>();
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant))
}
