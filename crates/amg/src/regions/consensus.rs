//! Which sources of a support really move as one.
//!
//! Near joints and contacts, neighbours within the tolerance of "one motion" still differ by more
//! than noise, and their mean is nobody's motion. Where a part is rigid, all that differs is noise,
//! which more sources average away. So sources are weighed by how well one rigid motion explains
//! them, in units of the noise of the trajectories: supports stay wide on rigid parts and shrink to
//! what agrees elsewhere.
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

/// Fits, each with the weights that the last one left.
const ROUNDS: usize = 2;

/// Key times looked at, as many as there are lanes.
const MAX_TIMES: usize = 4;

type Times = Lanes<MAX_TIMES>;

/// Root mean square misfit, in units of the noise, at which a source counts half or so.
const MISFIT: f64 = 1.5;

/// If all agree at least this well, another fit would change nothing.
const AGREED: f64 = 0.7;

/// Weight that any misfit leaves: where nothing agrees, all count alike.
const LEAST: f64 = 1e-6;

/// Most sources a support has, see [`crate::MotionParams::sources_per_row`].
pub(super) const MAX_SOURCES: usize = 64;

/// What a source does at the times compared, one lane each: centres, rotations since the edit
/// frame, how far it is there.
#[derive(Debug, Clone, Copy)]
struct Moved {
    place: [[f32; MAX_TIMES]; 3],
    turn: [[f32; MAX_TIMES]; 4],
    seen: [f32; MAX_TIMES],
}

/// Finds what agrees.
pub(super) struct Consensus<'a> {
    regions: &'a Regions,
    /// Of each point of `regions`.
    moved: Vec<Moved>,
    /// Key times compared.
    num_times: usize,
    /// Weight of own rotations.
    prior: f64,
}

impl<'a> Consensus<'a> {
    pub(super) fn new(keys: &KeyFrames, regions: &'a Regions, rotation_quality: f64) -> Self {
        let num_times = keys.times.len().min(MAX_TIMES);
        // The last one included, and none twice.
        let times: Vec<usize> =
            (1..=num_times).map(|i| i * keys.times.len() / num_times - 1).collect();
        let moved = |&id: &usize| {
            // Lanes without a time repeat the first one and see nothing.
            let at = |lane: usize| times.get(lane).map_or(times[0], |&k| k);
            let mut moved = Moved {
                place: [[0.0; MAX_TIMES]; 3],
                turn: [[0.0; MAX_TIMES]; 4],
                seen: [0.0; MAX_TIMES],
            };
            for lane in 0..MAX_TIMES {
                for (values, value) in moved.place.iter_mut().zip(keys.means[at(lane)][id]) {
                    values[lane] = value;
                }
                for (values, value) in moved.turn.iter_mut().zip(keys.turns[at(lane)][id]) {
                    values[lane] = value;
                }
                if lane < num_times {
                    moved.seen[lane] = keys.seen(at(lane), id).as_f32();
                }
            }
            moved
        };
        let ids = if num_times == 0 { &[][..] } else { &regions.ids };
        let moved = ids.par_iter().with_min_len(1024).map(moved).collect();
        Self { regions, moved, num_times, prior: ROTATION_PRIOR * rotation_quality }
    }

    /// Lowers the weights of points of `regions` that do not share the motion of the others.
    pub(super) fn reweigh(&self, entries: &mut [(u32, f64)]) {
        let reach = MISFIT * self.regions.noise;
        // Three always fit.
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
                || self.misfits(entries, squares),
            );
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

    /// Squared distances, summed over the times, of where each entry goes from where the rigid
    /// motion of all of them takes it.
    #[inline(always)]
    fn misfits(&self, entries: &[(u32, f64)], squares: &mut [f64]) {
        // Motions are compared in place: rests are about the scene's origin, and what they move to
        // is about the first.
        let origin = wide(&self.moved[entries[0].0 as usize].place);
        let rest = |point: u32| self.regions.means[point as usize].map(Times::all);
        let place = |moved: &Moved| {
            let [x, y, z] = wide(&moved.place);
            [x - origin[0], y - origin[1], z - origin[2]]
        };
        let (mut from, mut to, mut total) = ([Times::ZERO; 3], [Times::ZERO; 3], 0.0);
        for &(point, weight) in entries {
            let (x, y) = (rest(point), place(&self.moved[point as usize]));
            for a in 0..3 {
                from[a] += Times::all(weight) * x[a];
                to[a] += Times::all(weight) * y[a];
            }
            total += weight;
        }
        let share = Times::all(1.0 / total);
        let mut fit = RigidFits::about(from.map(|v| v * share), to.map(|v| v * share));
        for &(point, weight) in entries {
            let (moved, weight) = (&self.moved[point as usize], Times::all(weight.sqrt()));
            fit.add(weight, rest(point), place(moved));
            fit.add_rotation(weight, wide(&moved.turn));
        }
        let turn = fit.rotation(self.prior);
        for (square, &(point, _)) in squares.iter_mut().zip(entries) {
            let moved = &self.moved[point as usize];
            let (x, y) = (fit.apply(turn, rest(point)), place(moved));
            let [seen] = wide(&[moved.seen]);
            let mut sum = Times::ZERO;
            for a in 0..3 {
                let miss = seen * (y[a] - x[a]);
                sum += miss * miss;
            }
            let [a, b, c, d] = sum.0;
            *square = (a + b) + (c + d);
        }
    }
}

#[inline(always)]
fn wide<const N: usize>(values: &[[f32; MAX_TIMES]; N]) -> [Times; N] {
    let mut out = [Times::ZERO; N];
    for (out, values) in out.iter_mut().zip(values) {
        for lane in 0..MAX_TIMES {
            out.0[lane] = f64::from(values[lane]);
        }
    }
    out
}
