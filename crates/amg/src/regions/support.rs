//! Supports: the source splats whose motion each edited splat follows.

use super::consensus::Consensus;
use super::cubes::{Cube, NEARBY};
use super::numeric::TINY;
use super::region_motion::{Path, RegionMotion};
use super::source::Regions;
use crate::rigid::{dot, norm, sub};
use crate::row_index::index;
use anchors::{KdTree, Neighbor};
use gs_core::Real;

/// Regions from which the source splats of a support are taken: enough for a choice, few enough to
/// stay near.
const MIN_REGIONS: usize = 8;

/// Width of the weights, in spacings of the regions.
const KERNEL: f64 = 2.0;

/// Ridge of the local linear regression, as a share of the total variance: a support has less than
/// this along the normal, where it cannot be centred.
const RIDGE: f64 = 0.15;

/// Range of the factors on weights: beside its support, a splat cannot be centred without amplifying
/// noise.
const CENTRING: [f64; 2] = [0.1, 4.0];

/// Radius of the support of a splat far from its region, as a share of the distance between them.
const LEVER: f64 = 0.5;

/// Regions compared at once.
const CHUNK: usize = 32;

/// Weights below this are left out: rounding.
const NEGLIGIBLE: f64 = 1e-9;

/// Buffers reused from splat to splat.
#[derive(Default)]
pub(super) struct Scratch {
    apart: Vec<f32>,
    path: Path,
    points: Vec<(f64, u32)>,
    first_of_region: Vec<(f64, u32)>,
    entries: Vec<(u32, f64)>,
    /// Neighbours of the region last used for far splats.
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
    /// Source splats around `x` that move like region `own`, and their weights.
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
            regions >= self.sources_per_row.max(MIN_REGIONS)
                || (regions >= MIN_REGIONS && points >= 4 * self.sources_per_row)
        };
        let limit = self.tolerance.powi(2);
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
        let width = (KERNEL * h).powi(2).max(TINY * TINY);
        let weigh = |&(squared, p): &(f64, u32)| {
            (p, (-0.5 * (squared - nearest) / width).exp() * self.regions.weights[p as usize])
        };
        entries.clear();
        entries.extend(points.iter().map(weigh).filter(|(_, weight)| *weight > NEGLIGIBLE));
        // Static sources agree.
        if !entries
            .iter()
            .all(|entry| self.motion.still[self.regions.cells.owners[entry.0 as usize] as usize])
        {
            self.consensus.reweigh(entries);
            self.centre(entries, x);
        }
        entries.iter().map(|&(p, w)| (index(self.regions.ids[p as usize]), w.as_f32())).collect()
    }

    /// Tilts the weights so that the centroid lies at `x` within the surface, as in local linear
    /// regression. Motion that varies linearly along a stretching or bending part then causes no
    /// bias, so supports may be wide. Along the normal, where supports have no spread, the rigid
    /// motion extrapolates.
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
        // C (C + ridge)⁻² (x − centroid).
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

    /// Source splats for a splat far from all of them that is attached to region `own`: one of each of
    /// the regions around it that move alike.
    pub(super) fn far(&self, x: [f64; 3], own: u32, scratch: &mut Scratch) -> Vec<(u32, f32)> {
        let Scratch { apart, path, around, ids, .. } = scratch;
        let centre = self.regions.centroids.rest[own as usize];
        // Splats of one piece share the region.
        let (asked, near) = around.get_or_insert_with(|| (u32::MAX, Vec::new()));
        if *asked != own {
            self.tree.nearest(&centre, NEARBY, near);
            *asked = own;
        }
        self.motion.path(own as usize, x.map(Real::as_f32), path);
        ids.clear();
        ids.extend(near.iter().map(|n| index(self.kept[n.id as usize])));
        self.motion.apart(path, ids, apart);
        // A lever amplifies errors of the rotation, so the longer it is, the wider is the support.
        let reach = LEVER * norm(sub(x, centre));
        let limit = self.tolerance.powi(2);
        let mut same = vec![own];
        for ((n, &region), &squared) in near.iter().zip(&*ids).zip(&*apart) {
            if n.distance_squared.sqrt() > reach && same.len() >= self.sources_per_row {
                break;
            }
            if squared <= limit && region != own {
                same.push(region);
            }
        }
        let count = same.len().min(self.sources_per_row);
        (0..count)
            .map(|i| same[i * same.len() / count])
            .map(|region| {
                let members = self.regions.members(region as usize);
                let point = members[members.len() / 2] as usize;
                (index(self.regions.ids[point]), self.regions.weights[point].as_f32())
            })
            .collect()
    }
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
