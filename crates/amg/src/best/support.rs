//! The sources each edited splat finally moves with.

use super::cells::{Cells, opacity_weight};
use super::cloud::TINY;
use super::consensus::Consensus;
use super::edit::Edit;
use super::modes::Choice;
use super::motion::CellMotion;
use crate::binding::index;
use crate::keyframes::KeyFrames;
use crate::rigid::{dot, eigen, norm, sub};
use anchors::KdTree;
use gs_core::Real;

/// Cells whose splats are considered: enough for a choice, few enough to stay near, unless they have but a splat each.
const MIN_CELLS: usize = 8;
const MAX_CELLS: usize = 24;

/// Cells looked at for a splat far from all of them.
const FAR_CELLS: usize = 256;

/// Sources of a support agree better than cells that count as one motion: share of the tolerance.
const SAME: f32 = 0.7;

/// Width of the weights, in cell spacings, and its growth with the squared distance of the nearest source.
const KERNEL: f64 = 1.8;
const KERNEL_GROWTH: f64 = 0.09;

/// Spread of a support across its surface, as a share of the whole, at which it is no direction to be centred in any more; and the
/// factors on weights that centring may ask for.
const RIDGE: f64 = 0.15;
const CENTRING: [f64; 2] = [0.1, 4.0];

/// Finds supports.
pub(super) struct Supports<'a> {
    pub(super) keys: &'a KeyFrames,
    pub(super) cells: &'a Cells,
    pub(super) motion: &'a CellMotion,
    pub(super) spacing: &'a [f64],
    pub(super) tolerance: f32,
    pub(super) sources_per_row: usize,
    pub(super) consensus: Consensus<'a>,
}

impl Supports<'_> {
    /// Sources of the same motion around the splat, nearest first, and weights.
    pub(super) fn near(
        &self,
        edit: &Edit,
        e: usize,
        choice: &Choice,
        chosen: usize,
        near: &[u32],
    ) -> Vec<(u32, f32)> {
        let rep = choice[chosen].cell;
        let x = edit.means[e];
        let mut points: Vec<(f64, u32)> = Vec::new();
        let mut first_of_cell: Vec<(f64, u32)> = Vec::new();
        let path = self.motion.path(rep as usize, x.map(Real::as_f32));
        let same = |&cell: &u32| self.motion.agrees(cell as usize, &path, SAME * self.tolerance);
        let cells = near.iter().copied().filter(same);
        for cell in cells.chain(std::iter::once(rep)) {
            let start = points.len();
            for &p in &self.cells.members[cell as usize] {
                let d = sub(self.cells.means[p as usize], x);
                points.push((dot(d, d), p));
            }
            first_of_cell
                .extend(points[start..].iter().copied().min_by(|a, b| a.0.total_cmp(&b.0)));
            if (first_of_cell.len() >= MAX_CELLS && points.len() >= self.sources_per_row)
                || (first_of_cell.len() >= MIN_CELLS && points.len() >= 4 * self.sources_per_row)
            {
                break;
            }
        }
        let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        // `rep` is usually among `near`, too: some points come twice.
        let needed = 2 * self.sources_per_row;
        if points.len() > needed {
            points.select_nth_unstable_by(needed, order);
            points.truncate(needed);
        }
        points.sort_unstable_by(order);
        points.dedup();
        // Half of them as near as possible, for the translation; the other half spread out, for the rotation.
        points.truncate(
            self.sources_per_row
                .div_ceil(2)
                .max(self.sources_per_row.saturating_sub(first_of_cell.len())),
        );
        first_of_cell.retain(|p| !points.contains(p));
        first_of_cell.sort_by(order);
        first_of_cell.truncate(self.sources_per_row.saturating_sub(points.len()));
        points.extend(first_of_cell);
        let h = self.spacing[rep as usize];
        let nearest = points[0].0;
        let width = (KERNEL * h).powi(2) + KERNEL_GROWTH * nearest;
        let width = width.max(TINY * TINY);
        let mut entries: Vec<(u32, f64)> = points
            .iter()
            .map(|&(squared, p)| {
                let kernel = (-0.5 * (squared - nearest) / width).exp();
                (p, kernel * opacity_weight(self.keys, self.cells.ids[p as usize]))
            })
            .filter(|(_, weight)| *weight > 1e-9)
            .collect();
        // Where nothing moves, nothing can disagree.
        if !entries
            .iter()
            .all(|entry| self.motion.still[self.cells.cell_of[entry.0 as usize] as usize])
        {
            self.consensus.reweigh(&mut entries);
            self.centre(&mut entries, x);
        }
        entries.iter().map(|&(p, w)| (index(self.cells.ids[p as usize]), w.as_f32())).collect()
    }

    /// Tilts the weights so that their centroid lies beside `x`, as in local linear regression: what a stretching or bending part does
    /// more of with every step aside then does no harm, and supports may be wide. Along the normal, across which supports have no
    /// spread, the rigid motion carries the offset.
    fn centre(&self, entries: &mut [(u32, f64)], x: [f64; 3]) {
        let total: f64 = entries.iter().map(|entry| entry.1).sum();
        let place = |point: u32| self.cells.means[point as usize];
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
        let (variances, axes) = eigen(covariance);
        let ridge = RIDGE * variances.iter().sum::<f64>();
        if ridge <= 0.0 {
            return;
        }
        let aside = sub(x, centroid);
        let mut tilt = [0.0; 3];
        for (i, variance) in variances.into_iter().enumerate() {
            let axis = axes.map(|row| row[i]);
            let along = dot(axis, aside) * variance / (variance + ridge).powi(2);
            for (t, a) in tilt.iter_mut().zip(axis) {
                *t += along * a;
            }
        }
        for (point, weight) in entries {
            let factor = 1.0 + dot(tilt, sub(place(*point), centroid));
            *weight *= factor.clamp(CENTRING[0], CENTRING[1]);
        }
    }

    /// Sources for a splat far from all of them that hangs on one which moves with `rep`: the wider the lever, the wider the
    /// support, as far as it moves as one.
    pub(super) fn far(
        &self,
        x: [f64; 3],
        rep: u32,
        tree: &KdTree<3>,
        kept: &[usize],
    ) -> Vec<(u32, f32)> {
        let centre = self.cells.cloud.means[rep as usize];
        let lever = norm(sub(x, centre));
        let mut near = Vec::new();
        tree.nearest(&centre, FAR_CELLS, &mut near);
        let reach = (0.5 * lever).max(2.0 * self.spacing[rep as usize]);
        let tolerance = (f64::from(self.tolerance) + 0.1 * lever).as_f32();
        let path = self.motion.path(rep as usize, x.map(Real::as_f32));
        let mut same = Vec::new();
        for n in near {
            if n.distance_squared.sqrt() > reach && same.len() >= self.sources_per_row {
                break;
            }
            let cell = index(kept[n.id as usize]);
            if self.motion.agrees(cell as usize, &path, tolerance) {
                same.push(cell);
            }
        }
        if !same.contains(&rep) {
            same.insert(0, rep);
        }
        let count = same.len().min(self.sources_per_row);
        (0..count)
            .map(|i| {
                let cell = same[i * same.len() / count];
                let members = &self.cells.members[cell as usize];
                let i = self.cells.ids[members[members.len() / 2] as usize];
                (index(i), opacity_weight(self.keys, i).as_f32())
            })
            .collect()
    }
}
