//! Robust weights of the sources of a support: iteratively reweighted rigid fits.
//!
//! Near joints and contacts, motions of neighbours within the tolerance of "one motion" differ by
//! more than noise, and their mean is not the motion of any part. On a rigid part they differ only
//! by noise, which averaging over more sources reduces. Sources are therefore weighted by how well
//! one rigid motion explains them, in units of the noise of the trajectories: supports are wide on
//! rigid parts; elsewhere they shrink to the sources that agree.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use super::region_motion::ROTATION_PRIOR;
use super::source::Regions;
use crate::keyframes::KeyFrames;
use crate::rigid::RigidFits;
use crate::simd::Lanes;
use gs_core::Real;
use rayon::prelude::*;

/// Number of fits, each with weights from the residuals of the previous one.
const ROUNDS: usize = 2;

/// Number of key times compared, one per lane.
const MAX_TIMES: usize = 4;

type TimeLanes = Lanes<MAX_TIMES>;

/// Scale of the weights: root mean square residual, in units of the noise, at which a source keeps
/// `e^(−1/2)` of its weight.
const MISFIT: f64 = 1.5;

/// If every source keeps at least this share of its weight, no further fit is needed.
const AGREED: f64 = 0.7;

/// Minimum share of the weight, at any residual: if no sources agree, all have equal weights.
const MIN_SHARE: f64 = 1e-6;

/// Maximum number of sources of a support, see [`crate::MotionParams::sources_per_row`].
pub(super) const MAX_SOURCES: usize = 64;

/// Motion of a source: centre, rotation since the edit frame (`wxyz`) and presence at the compared
/// times, one lane each.
#[derive(Debug, Clone, Copy)]
struct ComparedMotion {
    center: [[f32; MAX_TIMES]; 3],
    rotation: [[f32; MAX_TIMES]; 4],
    presence: [f32; MAX_TIMES],
}

/// Reweights the sources of supports.
pub(super) struct Consensus<'a> {
    regions: &'a Regions,
    /// Motion of each point of `regions`.
    motions: Vec<ComparedMotion>,
    /// Key times compared.
    num_times: usize,
    /// Weight of the sources' own rotations in the fits.
    prior: f64,
}

impl<'a> Consensus<'a> {
    pub(super) fn new(keys: &KeyFrames, regions: &'a Regions, rotation_quality: f64) -> Self {
        let num_times = keys.times.len().min(MAX_TIMES);
        // Evenly spaced, distinct, the last one included.
        let times: Vec<usize> =
            (1..=num_times).map(|i| i * keys.times.len() / num_times - 1).collect();
        let motion = |&id: &usize| {
            // Lanes without a time repeat the first one with presence 0.
            let at = |lane: usize| times.get(lane).map_or(times[0], |&k| k);
            let mut motion = ComparedMotion {
                center: [[0.0; MAX_TIMES]; 3],
                rotation: [[0.0; MAX_TIMES]; 4],
                presence: [0.0; MAX_TIMES],
            };
            for lane in 0..MAX_TIMES {
                for (values, value) in motion.center.iter_mut().zip(keys.means[at(lane)][id]) {
                    values[lane] = value;
                }
                for (values, value) in motion.rotation.iter_mut().zip(keys.rotations[at(lane)][id])
                {
                    values[lane] = value;
                }
                if lane < num_times {
                    motion.presence[lane] = keys.seen(at(lane), id).as_f32();
                }
            }
            motion
        };
        let ids = if num_times == 0 { &[][..] } else { &regions.ids };
        let motions = ids.par_iter().with_min_len(1024).map(motion).collect();
        Self { regions, motions, num_times, prior: ROTATION_PRIOR * rotation_quality }
    }

    /// Lowers the weights of points of `regions` whose motion differs from that of the others.
    pub(super) fn reweight(&self, entries: &mut [(u32, f64)]) {
        let reach = MISFIT * self.regions.noise;
        // Residuals of three points are too small to be informative.
        if entries.len() < 4 || reach <= 0.0 || self.num_times == 0 {
            return;
        }
        let (mut spatial, mut squares) = ([0.0; MAX_SOURCES], [0.0; MAX_SOURCES]);
        let (spatial, squares) = (&mut spatial[..entries.len()], &mut squares[..entries.len()]);
        for (spatial, entry) in spatial.iter_mut().zip(&*entries) {
            *spatial = entry.1;
        }
        let scale = -0.5 / (reach * reach * self.num_times as f64);
        for _ in 0..ROUNDS {
            crate::simd::dispatch(
                #[inline(always)]
                || self.squared_residuals(entries, squares),
            );
            let mut smallest = 1.0_f64;
            for ((entry, spatial), square) in entries.iter_mut().zip(&*spatial).zip(&*squares) {
                let agreement = (scale * square).exp().max(MIN_SHARE);
                smallest = smallest.min(agreement);
                entry.1 = spatial * agreement;
            }
            if smallest > AGREED {
                break;
            }
        }
    }

    /// Squared residuals of the entries' positions under the common rigid motion, summed over the
    /// times, world units².
    #[inline(always)]
    fn squared_residuals(&self, entries: &[(u32, f64)], squares: &mut [f64]) {
        // Positions at rest are relative to the origin of the pose, those at the key times to the
        // first entry, so that sums stay accurate far from the world's origin.
        let origin = widen(&self.motions[entries[0].0 as usize].center);
        let rest = |point: u32| self.regions.means[point as usize].map(TimeLanes::all);
        let center = |motion: &ComparedMotion| {
            let [x, y, z] = widen(&motion.center);
            [x - origin[0], y - origin[1], z - origin[2]]
        };
        let (mut from, mut to, mut total) = ([TimeLanes::ZERO; 3], [TimeLanes::ZERO; 3], 0.0);
        for &(point, weight) in entries {
            let (x, y) = (rest(point), center(&self.motions[point as usize]));
            for a in 0..3 {
                from[a] += TimeLanes::all(weight) * x[a];
                to[a] += TimeLanes::all(weight) * y[a];
            }
            total += weight;
        }
        let share = TimeLanes::all(1.0 / total);
        let mut fit = RigidFits::about(from.map(|v| v * share), to.map(|v| v * share));
        for &(point, weight) in entries {
            let motion = &self.motions[point as usize];
            let weight = TimeLanes::all(weight.sqrt());
            fit.add(weight, rest(point), center(motion));
            fit.add_rotation(weight, widen(&motion.rotation));
        }
        let rotation = fit.rotation(self.prior);
        for (square, &(point, _)) in squares.iter_mut().zip(entries) {
            let motion = &self.motions[point as usize];
            let (x, y) = (fit.apply(rotation, rest(point)), center(motion));
            let [presence] = widen(&[motion.presence]);
            let mut sum = TimeLanes::ZERO;
            for a in 0..3 {
                let residual = presence * (y[a] - x[a]);
                sum += residual * residual;
            }
            let [a, b, c, d] = sum.0;
            *square = (a + b) + (c + d);
        }
    }
}

#[inline(always)]
fn widen<const N: usize>(values: &[[f32; MAX_TIMES]; N]) -> [TimeLanes; N] {
    let mut out = [TimeLanes::ZERO; N];
    for (out, values) in out.iter_mut().zip(values) {
        for lane in 0..MAX_TIMES {
            out.0[lane] = f64::from(values[lane]);
        }
    }
    out
}
