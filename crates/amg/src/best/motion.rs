//! Rigid motion of each cell's surroundings, at each key time.

use super::cloud::{Cloud, Companions, median};
use crate::rigid::RigidFit;
use gs_core::{Real, quat};
use rayon::prelude::*;

/// Weight of the splats' own rotations, if they agree with how the splats move.
const ROTATION_PRIOR: f64 = 0.3;

/// Disagreement between own rotations and positions, radians, at which the former lose most of their weight.
const ROTATION_TRUST: f64 = 0.1;

/// Rigid motions of the cells. Cells that are floaters themselves are marked and not followed.
#[derive(Debug)]
pub(super) struct CellMotion {
    pub(super) floater: Vec<bool>,
    /// Factor on the weight of own rotations, 0 to 1: 0 where the scene does not model rotation.
    pub(super) rotation_trust: f64,
    /// `[N][T]`.
    motions: Vec<Motion>,
    num_times: usize,
}

/// `x ↦ R (x − from) + to`.
#[derive(Debug, Clone, Copy, Default)]
struct Motion {
    turn: [f32; 4],
    from: [f32; 3],
    to: [f32; 3],
}

impl CellMotion {
    pub(super) fn of(cloud: &Cloud, companions: &Companions) -> Self {
        let floater = companions.floaters(cloud);
        let num_times = cloud.num_times();
        let stencil = |i: usize| -> Vec<(f64, usize)> {
            (0..companions.near[i].len())
                .map(|slot| {
                    let j = companions.near[i][slot].id as usize;
                    let weight = companions.spatial(cloud, i, slot) * companions.agree[i][slot];
                    (if floater[j] && slot > 0 { 0.0 } else { weight }, j)
                })
                .filter(|(weight, _)| *weight > 1e-9)
                .collect()
        };
        let trust = rotation_trust(cloud, &floater, &stencil);
        let motions = (0..cloud.len())
            .into_par_iter()
            .with_min_len(64)
            .flat_map_iter(|i| {
                let stencil = stencil(i);
                (0..num_times).map(move |k| {
                    let fit = fit(cloud, k, &stencil);
                    fit.into_motion(ROTATION_PRIOR * trust)
                })
            })
            .collect();
        Self { floater, rotation_trust: trust, motions, num_times }
    }

    /// Where point `x` goes at key time `k` if it moves with cell `i`.
    fn carry(&self, i: usize, k: usize, x: [f32; 3]) -> [f32; 3] {
        let motion = &self.motions[i * self.num_times + k];
        let arm = [x[0] - motion.from[0], x[1] - motion.from[1], x[2] - motion.from[2]];
        let turned = quat::rotate(motion.turn, arm);
        [turned[0] + motion.to[0], turned[1] + motion.to[1], turned[2] + motion.to[2]]
    }

    /// Largest distance over time between where cells `a` and `b` take point `x`.
    pub(super) fn disagreement(&self, a: usize, b: usize, x: [f32; 3]) -> f32 {
        if a == b {
            return 0.0;
        }
        let squared = (0..self.num_times).fold(0.0_f32, |worst, k| {
            let (p, q) = (self.carry(a, k, x), self.carry(b, k, x));
            let d = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
            worst.max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        });
        squared.sqrt()
    }
}

struct Fit {
    sums: RigidFit,
    from: [f64; 3],
    to: [f64; 3],
}

impl Fit {
    fn into_motion(self, prior: f64) -> Motion {
        Motion {
            turn: self.sums.rotation(prior).map(f32::from_double),
            from: self.from.map(f32::from_double),
            to: self.to.map(f32::from_double),
        }
    }
}

fn fit(cloud: &Cloud, k: usize, stencil: &[(f64, usize)]) -> Fit {
    let (mut from, mut to, mut total) = ([0.0; 3], [0.0; 3], 0.0);
    for &(weight, i) in stencil {
        for a in 0..3 {
            from[a] += weight * cloud.means[i][a];
            to[a] += weight * cloud.means_t[k][i][a];
        }
        total += weight;
    }
    let (from, to) = (from.map(|v| v / total), to.map(|v| v / total));
    let mut sums = RigidFit::about(from, to);
    for &(weight, i) in stencil {
        sums.add(weight, cloud.means[i], cloud.means_t[k][i]);
        sums.add_rotation(weight, cloud.turns_t[k][i]);
    }
    Fit { sums, from, to }
}

/// Compares the mean own rotation of neighbourhoods with the one their positions show, on a sample.
fn rotation_trust(
    cloud: &Cloud,
    floater: &[bool],
    stencil: &(impl Fn(usize) -> Vec<(f64, usize)> + Sync),
) -> f64 {
    let step = (cloud.len() / 2000).max(1);
    let mut angles: Vec<f64> = (0..cloud.len())
        .into_par_iter()
        .step_by(step)
        .filter(|&i| !floater[i])
        .flat_map_iter(|i| {
            let stencil = stencil(i);
            (0..cloud.num_times()).map(move |k| {
                let fit = fit(cloud, k, &stencil);
                let (shown, own) = (fit.sums.rotation(0.0), fit.sums.rotation(1e6));
                2.0 * quat::dot(shown, own).abs().min(1.0).acos()
            })
        })
        .collect();
    let typical = median(&mut angles);
    (-(typical / ROTATION_TRUST).powi(2)).exp()
}
