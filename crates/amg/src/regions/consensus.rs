//! Which sources of a support really move as one.
//!
//! Near joints and contacts, neighbours within the tolerance of "one motion" still differ by more than noise, and their mean is nobody's
//! motion. Where a part is rigid, all that differs is noise, which more sources average away. So sources are weighed by how
//! well one rigid motion explains them, in units of the noise of the trajectories: supports stay wide on rigid parts and
//! shrink to what agrees elsewhere.

use super::region_motion::ROTATION_PRIOR;
use super::source::Regions;
use crate::keyframes::KeyFrames;
use crate::rigid::{RigidFit, dot, sub};

/// Fits, each with the weights that the last one left.
const ROUNDS: usize = 2;

/// Key times looked at.
const MAX_TIMES: usize = 4;

/// Root mean square misfit, in units of the noise, at which a source counts half or so.
const MISFIT: f64 = 1.5;

/// If all agree at least this well, another fit would change nothing.
const AGREED: f64 = 0.7;

/// Weight that any misfit leaves: where nothing agrees, all count alike.
const LEAST: f64 = 1e-6;

/// Most sources a support has, see [`crate::MotionParams::sources_per_row`].
pub(super) const MAX_SOURCES: usize = 64;

/// Finds what agrees.
pub(super) struct Consensus<'a> {
    keys: &'a KeyFrames,
    regions: &'a Regions,
    /// Key times compared.
    times: Vec<usize>,
    /// Weight of own rotations.
    prior: f64,
}

impl<'a> Consensus<'a> {
    pub(super) fn new(keys: &'a KeyFrames, regions: &'a Regions, rotation_quality: f64) -> Self {
        let count = keys.times.len().min(MAX_TIMES);
        // The last one included, and none twice.
        let times = (1..=count).map(|i| i * keys.times.len() / count - 1).collect();
        Self { keys, regions, times, prior: ROTATION_PRIOR * rotation_quality }
    }

    /// Lowers the weights of points of `regions` that do not share the motion of the others.
    pub(super) fn reweigh(&self, entries: &mut [(u32, f64)]) {
        let reach = MISFIT * self.regions.noise;
        // Three always fit.
        if entries.len() < 4 || reach <= 0.0 || self.times.is_empty() {
            return;
        }
        let (mut spatial, mut squares) = ([0.0; MAX_SOURCES], [0.0; MAX_SOURCES]);
        let (spatial, squares) = (&mut spatial[..entries.len()], &mut squares[..entries.len()]);
        for (spatial, entry) in spatial.iter_mut().zip(&*entries) {
            *spatial = entry.1;
        }
        for _ in 0..ROUNDS {
            squares.fill(0.0);
            for &k in &self.times {
                self.add_misfits(k, entries, squares);
            }
            let scale = -0.5 / (reach * reach * self.times.len() as f64);
            let mut least = 1.0_f64;
            for ((entry, spatial), square) in entries.iter_mut().zip(&*spatial).zip(&*squares) {
                let agreement = (scale * square).exp().max(LEAST);
                least = least.min(agreement);
                entry.1 = spatial * agreement;
            }
            if least > AGREED {
                break;
            }
        }
    }

    fn add_misfits(&self, k: usize, entries: &[(u32, f64)], squares: &mut [f64]) {
        let means = &self.keys.means[k];
        // Motions are compared in place: rests are about the scene's origin, and what they move to is about the first.
        let origin = means[self.regions.ids[entries[0].0 as usize]].map(f64::from);
        let pair = |point: u32| {
            let point = point as usize;
            (self.regions.means[point], sub(means[self.regions.ids[point]].map(f64::from), origin))
        };
        let (mut from, mut to, mut total) = ([0.0; 3], [0.0; 3], 0.0);
        for &(point, weight) in entries {
            let (x, y) = pair(point);
            for a in 0..3 {
                from[a] += weight * x[a];
                to[a] += weight * y[a];
            }
            total += weight;
        }
        let mut fit = RigidFit::about(from.map(|v| v / total), to.map(|v| v / total));
        for &(point, weight) in entries {
            let (x, y) = pair(point);
            fit.add(weight.sqrt(), x, y);
            let turn = self.keys.turns[k][self.regions.ids[point as usize]];
            fit.add_rotation(weight.sqrt(), turn.map(f64::from));
        }
        let turn = fit.rotation(self.prior);
        for (square, &(point, _)) in squares.iter_mut().zip(entries) {
            let (x, y) = pair(point);
            let miss = sub(y, fit.apply(turn, x));
            let seen = self.keys.seen(k, self.regions.ids[point as usize]);
            *square += seen * seen * dot(miss, miss);
        }
    }
}
