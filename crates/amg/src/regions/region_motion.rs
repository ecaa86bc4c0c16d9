//! Rigid motion of each region at each key time, fitted to the region and its neighbours.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use crate::keyframes::FADED;
use crate::rigid::RigidFits;
use crate::simd::Lanes;
use anchors::{RigidNeighbors, Trajectories};
use gs_core::{Real, nearest_rank, quat};
use rayon::prelude::*;

/// Weight of the splats' own rotations relative to their positions if both are equally accurate;
/// see [`crate::Aggregation`].
pub(super) const ROTATION_PRIOR: f64 = 3.0;

/// Smaller weights do not change a fit beyond rounding and are omitted.
const NEGLIGIBLE: f64 = 1e-9;

/// Number of neighbourhoods sampled to estimate the accuracy of the splats' own rotations.
const SAMPLE: usize = 2000;

/// Number of key times compared at once: one vector register of `f32`.
const LANES: usize = 8;

type Lane = [f32; LANES];

/// The 3×4 matrices `[R | p]` of one region at eight key times.
type Block = [[Lane; 4]; 3];

/// Rigid motions of the regions. Outliers among the regions are marked; no splat follows them.
#[derive(Debug)]
pub(super) struct RegionMotion {
    pub(super) outlier: Vec<bool>,
    /// Regions that do not move and have no moving neighbour.
    pub(super) still: Vec<bool>,
    /// Factor on the weight of own rotations, 0 to 1; 0 if the scene does not model rotation.
    pub(super) rotation_quality: f64,
    /// `x ↦ R x + p`, `[R][T/8]`; the last block is padded with identities.
    motions: Vec<Block>,
    /// Presence of the region, 0 to 1, `[R][T/8]`; empty if all are always present.
    presence: Vec<Lane>,
    num_blocks: usize,
}

/// Positions of a point that moves with one region, at all key times.
#[derive(Debug, Default)]
pub(super) struct Path {
    region: usize,
    from: [f32; 3],
    positions: Vec<[Lane; 3]>,
}

impl RegionMotion {
    pub(super) fn of(
        regions: &Trajectories,
        rotations: &[[f64; 4]],
        neighbors: &RigidNeighbors,
    ) -> Self {
        let outlier = neighbors.outliers(regions);
        let num_times = regions.num_times();
        let stencil = |i: usize| -> Vec<(f64, usize)> {
            let others = neighbors.get(i).filter_map(|(n, agreement)| {
                let weight = neighbors.nearness(regions, i, n) * agreement;
                (!outlier[n.id as usize]).then_some((weight, n.id as usize))
            });
            std::iter::once((regions.weights[i], i))
                .chain(others)
                .filter(|(weight, _)| *weight > NEGLIGIBLE)
                .collect()
        };
        let quality = rotation_quality(regions, rotations, &outlier, &stencil);
        let still: Vec<bool> = (0..regions.len())
            .map(|i| {
                let moves = |n: anchors::Neighbor| regions.moving[n.id as usize];
                !regions.moving[i] && !neighbors.get(i).any(|(n, _)| moves(n))
            })
            .collect();
        let prior = ROTATION_PRIOR * quality;
        let num_blocks = num_times.div_ceil(LANES);
        let motions = (0..regions.len())
            .into_par_iter()
            .with_min_len(64)
            .flat_map_iter(|i| {
                let mut blocks = vec![IDENTITY; num_blocks];
                let stencil = if still[i] { Vec::new() } else { stencil(i) };
                if !stencil.is_empty() {
                    crate::simd::dispatch(
                        #[inline(always)]
                        || fit_all(regions, rotations, &stencil, prior, &mut blocks),
                    );
                }
                blocks
            })
            .collect();
        let presence = if regions.presence.is_empty() {
            Vec::new()
        } else {
            let at = |k: usize, i: usize| {
                if k < num_times { f32::from_double(regions.present(k, i)) } else { 0.0 }
            };
            let block = |i: usize, b: usize| std::array::from_fn(|lane| at(b * LANES + lane, i));
            (0..regions.len()).flat_map(|i| (0..num_blocks).map(move |b| block(i, b))).collect()
        };
        Self { outlier, still, rotation_quality: quality, motions, presence, num_blocks }
    }

    fn blocks(&self, i: usize) -> std::ops::Range<usize> {
        i * self.num_blocks..(i + 1) * self.num_blocks
    }

    /// Positions of point `x` if it moves with region `i`. Replaces `out`.
    pub(super) fn path(&self, i: usize, x: [f32; 3], out: &mut Path) {
        out.positions.clear();
        out.positions.extend(self.motions[self.blocks(i)].iter().map(|block| transform(block, x)));
        (out.region, out.from) = (i, x);
    }

    /// For each of `regions`, the maximum over time of the squared distance between the point of
    /// `path` and the same point moved with that region, world units². Distances are multiplied by
    /// the presence of both regions. Replaces `out`.
    pub(super) fn max_squared_distances(&self, path: &Path, regions: &[u32], out: &mut Vec<f32>) {
        out.clear();
        crate::simd::dispatch(
            #[inline(always)]
            || {
                for &region in regions {
                    out.push(self.max_squared_distance(path, region as usize));
                }
            },
        );
    }

    /// Maximum over time of the distance between `x` moved with region `a` and with region `b`,
    /// times the presence of both, world units.
    pub(super) fn max_distance(&self, a: usize, b: usize, x: [f32; 3]) -> f32 {
        if self.share_motion(a, b) {
            return 0.0;
        }
        let blocks = self.blocks(a).zip(self.blocks(b));
        let worst = blocks.fold([0.0; LANES], |worst, (p, q)| {
            self.update_maxima(worst, &transform(&self.motions[p], x), p, q, x)
        });
        worst.into_iter().fold(0.0_f32, f32::max).sqrt()
    }

    #[inline(always)]
    fn max_squared_distance(&self, path: &Path, region: usize) -> f32 {
        if self.share_motion(region, path.region) {
            return 0.0;
        }
        let (p, q) = (path.region * self.num_blocks, region * self.num_blocks);
        let mut worst = [0.0; LANES];
        for (block, positions) in path.positions.iter().enumerate() {
            worst = self.update_maxima(worst, positions, p + block, q + block, path.from);
        }
        let mut farthest = 0.0;
        for square in worst {
            farthest = if square > farthest { square } else { farthest };
        }
        farthest
    }

    /// Maximum of `worst` and the squared distances within one block of key times between
    /// `positions`, which is `x` moved by block `p`, and `x` moved by block `q`.
    #[inline(always)]
    fn update_maxima(
        &self,
        mut worst: Lane,
        positions: &[Lane; 3],
        p: usize,
        q: usize,
        x: [f32; 3],
    ) -> Lane {
        let others = transform(&self.motions[q], x);
        let mut squares = [0.0_f32; LANES];
        for axis in 0..3 {
            for lane in 0..LANES {
                let d = positions[axis][lane] - others[axis][lane];
                squares[lane] += d * d;
            }
        }
        if !self.presence.is_empty() {
            for lane in 0..LANES {
                let both = self.presence[p][lane].min(self.presence[q][lane]);
                squares[lane] *= both * both;
            }
        }
        for lane in 0..LANES {
            worst[lane] = if squares[lane] > worst[lane] { squares[lane] } else { worst[lane] };
        }
        worst
    }

    /// Whether two regions are known to have equal motions (both are static).
    #[inline(always)]
    fn share_motion(&self, a: usize, b: usize) -> bool {
        a == b || (self.still[a] && self.still[b])
    }
}

const IDENTITY: Block = {
    let mut block = [[[0.0; LANES]; 4]; 3];
    (block[0][0], block[1][1], block[2][2]) = ([1.0; LANES], [1.0; LANES], [1.0; LANES]);
    block
};

#[inline(always)]
fn transform(block: &Block, x: [f32; 3]) -> [Lane; 3] {
    let mut out = [[0.0; LANES]; 3];
    for axis in 0..3 {
        let row = &block[axis];
        for lane in 0..LANES {
            out[axis][lane] =
                row[0][lane] * x[0] + row[1][lane] * x[1] + row[2][lane] * x[2] + row[3][lane];
        }
    }
    out
}

/// Fits the motions of one neighbourhood at all key times.
#[inline(always)]
fn fit_all(
    regions: &Trajectories,
    rotations: &[[f64; 4]],
    stencil: &[(f64, usize)],
    prior: f64,
    blocks: &mut [Block],
) {
    let num_times = regions.num_times();
    for first in (0..num_times).step_by(FITS) {
        let fits = Fits::of(regions, rotations, first, stencil);
        let rotation = fits.sums.rotation(prior);
        for lane in 0..FITS.min(num_times - first) {
            let k = first + lane;
            fits.write(rotation, lane, &mut blocks[k / LANES], k % LANES);
        }
    }
}

/// Number of key times fitted at once: one vector register of `f64`.
const FITS: usize = 4;

type FitLanes = Lanes<FITS>;

/// Sums of one neighbourhood at a few key times, one lane each.
struct Fits {
    sums: RigidFits<FITS>,
    from: [FitLanes; 3],
    to: [FitLanes; 3],
    /// Key time of each lane.
    times: [usize; FITS],
}

impl Fits {
    /// Sums at the key times from `first` on; lanes beyond the last key time repeat it.
    #[inline(always)]
    fn of(
        regions: &Trajectories,
        rotations: &[[f64; 4]],
        first: usize,
        stencil: &[(f64, usize)],
    ) -> Self {
        let num_times = regions.num_times();
        let mut times = [num_times - 1; FITS];
        for (lane, time) in times.iter_mut().enumerate() {
            *time = (*time).min(first + lane);
        }
        let (mut from, mut to) = ([FitLanes::ZERO; 3], [FitLanes::ZERO; 3]);
        let mut total = FitLanes::ZERO;
        for &(weight, i) in stencil {
            let weight = weights_at(regions, &times, i, weight);
            let (x, y) = (regions.rest[i].map(FitLanes::all), at_times(regions.places(i), &times));
            for a in 0..3 {
                from[a] += weight * x[a];
                to[a] += weight * y[a];
            }
            total += weight;
        }
        let share = total.map(f64::recip);
        let (from, to) = (from.map(|v| v * share), to.map(|v| v * share));
        let mut sums = RigidFits::about(from, to);
        for &(weight, i) in stencil {
            let weight = weights_at(regions, &times, i, weight);
            sums.add(
                weight,
                regions.rest[i].map(FitLanes::all),
                at_times(regions.places(i), &times),
            );
            sums.add_rotation(weight, at_times(&rotations[i * num_times..][..num_times], &times));
        }
        Self { sums, from, to, times }
    }

    #[inline(always)]
    fn write(&self, rotation: [FitLanes; 4], lane: usize, block: &mut Block, slot: usize) {
        let of = |values: &[FitLanes; 3]| values.map(|value| value.0[lane]);
        let rotation = rotation.map(|value| value.0[lane]);
        let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|axis| quat::rotate(rotation, axis));
        let rotated = quat::rotate(rotation, of(&self.from));
        for row in 0..3 {
            for (column, values) in columns.iter().enumerate() {
                block[row][column][slot] = f32::from_double(values[row]);
            }
            block[row][3][slot] = f32::from_double(self.to[row].0[lane] - rotated[row]);
        }
    }
}

/// Weight of a neighbour at each time. If all have faded, they keep their relative weights.
#[inline(always)]
fn weights_at(regions: &Trajectories, times: &[usize; FITS], i: usize, weight: f64) -> FitLanes {
    let mut out = FitLanes::all(weight);
    for lane in 0..FITS {
        out.0[lane] *= regions.present(times[lane], i) + FADED;
    }
    out
}

#[inline(always)]
fn at_times<const N: usize>(values: &[[f64; N]], times: &[usize; FITS]) -> [FitLanes; N] {
    let mut out = [FitLanes::ZERO; N];
    for lane in 0..FITS {
        for (out, value) in out.iter_mut().zip(values[times[lane]]) {
            out.0[lane] = value;
        }
    }
    out
}

/// Accuracy of the splats' own rotations relative to their positions, 0 to 1, from a sample of
/// neighbourhoods.
///
/// The mean own rotation of a neighbourhood and the rotation fitted to its positions differ by the
/// errors of both. The error of the fit follows from its residual; the remainder is the error of
/// the own rotations. The two are weighted by the inverse of their variances.
fn rotation_quality(
    regions: &Trajectories,
    rotations: &[[f64; 4]],
    outlier: &[bool],
    stencil: &(impl Fn(usize) -> Vec<(f64, usize)> + Sync),
) -> f64 {
    let step = (regions.len() / SAMPLE).max(1);
    let num_times = regions.num_times();
    let compared: Vec<[f64; 2]> = (0..regions.len())
        .into_par_iter()
        .step_by(step)
        .filter(|&i| !outlier[i])
        .flat_map_iter(|i| {
            let stencil = stencil(i);
            (0..num_times).step_by(FITS).flat_map(move |first| {
                let fits = Fits::of(regions, rotations, first, &stencil);
                let (fitted, own) = (fits.sums.rotation(0.0), fits.sums.rotation(1e6));
                let variance = rotation_variance(regions, &stencil, &fits, fitted);
                (0..FITS.min(num_times - first)).map(move |lane| {
                    let [fitted, own] = [fitted, own].map(|q| q.map(|value| value.0[lane]));
                    let angle = 2.0 * quat::dot(fitted, own).abs().min(1.0).acos();
                    [angle * angle, variance.0[lane]]
                })
            })
        })
        .collect();
    let middle = |which: usize| {
        let mut values: Vec<f64> = compared.iter().map(|c| c[which]).collect();
        nearest_rank(&mut values, 0.5).unwrap_or(0.0)
    };
    let (difference, positions) = (middle(0), middle(1));
    // 3e-8 rad² is a hundredth of a degree; smaller differences are rounding.
    let own = (difference - positions).max(positions / ROTATION_PRIOR).max(3e-8);
    (positions.max(1e-7) / own / ROTATION_PRIOR).min(1.0)
}

/// Expected squared error, radians², of the rotations fitted to positions alone.
fn rotation_variance(
    regions: &Trajectories,
    stencil: &[(f64, usize)],
    fits: &Fits,
    rotation: [FitLanes; 4],
) -> FitLanes {
    let (mut total, mut squares) = (0.0, 0.0);
    let (mut spread, mut residual) = (FitLanes::ZERO, FitLanes::ZERO);
    for &(weight, i) in stencil {
        let rest = regions.rest[i].map(FitLanes::all);
        let moved = at_times(regions.places(i), &fits.times);
        let expected = fits.sums.apply(rotation, rest);
        total += weight;
        squares += weight * weight;
        for a in 0..3 {
            let (arm, miss) = (rest[a] - fits.from[a], moved[a] - expected[a]);
            spread += FitLanes::all(weight) * arm * arm;
            residual += FitLanes::all(weight) * miss * miss;
        }
    }
    let effective: f64 = total * total / squares;
    // Three rotation axes, each with a lever arm of two thirds of the extent; the fit consumes the
    // degrees of freedom of two points.
    let mut variance = FitLanes::all(1.5) * residual;
    for lane in 0..FITS {
        let value = variance.0[lane] / (spread.0[lane] * (effective - 2.0).max(1.0));
        variance.0[lane] = if value.is_finite() { value } else { 0.0 };
    }
    variance
}
