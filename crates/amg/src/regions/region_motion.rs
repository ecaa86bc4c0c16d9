//! Rigid motion of each region's surroundings, at each key time.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use crate::keyframes::FADED;
use crate::rigid::RigidFits;
use crate::simd::Lanes;
use anchors::{RigidNeighbors, Trajectories};
use gs_core::{Real, quat};
use rayon::prelude::*;

/// Weight of the splats' own rotations relative to their positions, if they are as good as any; see
/// [`crate::Aggregation`].
pub(super) const ROTATION_PRIOR: f64 = 3.0;

/// Weights below this share of a neighbour's are left out of fits: rounding.
const NEGLIGIBLE: f64 = 1e-9;

/// Neighbourhoods looked at to tell how good own rotations are.
const SAMPLE: usize = 2000;

/// Key times compared at once.
const LANES: usize = 8;

type Lane = [f32; LANES];

/// The 3×4 matrices `[R | p]` of one region at eight key times.
type Block = [[Lane; 4]; 3];

/// Rigid motions of the regions. Regions that are outliers themselves are marked and not followed.
#[derive(Debug)]
pub(super) struct RegionMotion {
    pub(super) outlier: Vec<bool>,
    /// Regions that stay where they are, as do all around them.
    pub(super) still: Vec<bool>,
    /// Factor on the weight of own rotations, 0 to 1: 0 where the scene does not model rotation.
    pub(super) rotation_quality: f64,
    /// `x ↦ R x + p`, `[R][T/8]`; key times that fill the last block move nothing.
    motions: Vec<Block>,
    /// How far the region is still there, `[R][T/8]`; empty if all always are.
    presence: Vec<Lane>,
    num_blocks: usize,
}

/// Where a point goes with one region, over the key times.
#[derive(Debug, Default)]
pub(super) struct Path {
    region: usize,
    from: [f32; 3],
    places: Vec<[Lane; 3]>,
}

impl RegionMotion {
    pub(super) fn of(
        regions: &Trajectories,
        turns: &[[f64; 4]],
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
        let quality = rotation_quality(regions, turns, &outlier, &stencil);
        let still: Vec<bool> = (0..regions.len())
            .map(|i| {
                let moves = |n: anchors::Neighbor| regions.moving[n.id as usize];
                !regions.moving[i] && !neighbors.get(i).any(|(n, _)| moves(n))
            })
            .collect();
        let num_blocks = num_times.div_ceil(LANES);
        let motions = (0..regions.len())
            .into_par_iter()
            .with_min_len(64)
            .flat_map_iter(|i| {
                let mut blocks = vec![STAYS; num_blocks];
                let stencil = if still[i] { Vec::new() } else { stencil(i) };
                if !stencil.is_empty() {
                    crate::simd::dispatch(
                        #[inline(always)]
                        || fit_all(regions, turns, &stencil, ROTATION_PRIOR * quality, &mut blocks),
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

    /// Where point `x` goes if it moves with region `i`.
    pub(super) fn path(&self, i: usize, x: [f32; 3], out: &mut Path) {
        out.places.clear();
        out.places.extend(self.motions[self.blocks(i)].iter().map(|block| carried(block, x)));
        (out.region, out.from) = (i, x);
    }

    /// For each of `regions`, the largest square over time of the distance between where it and
    /// `path` take the point, as far as both regions are there. Replaces `out`.
    pub(super) fn apart(&self, path: &Path, regions: &[u32], out: &mut Vec<f32>) {
        out.clear();
        crate::simd::dispatch(
            #[inline(always)]
            || {
                for &region in regions {
                    out.push(self.farthest(path, region as usize));
                }
            },
        );
    }

    /// Largest distance over time between where regions `a` and `b` take point `x`, as far as both
    /// are there.
    pub(super) fn disagreement(&self, a: usize, b: usize, x: [f32; 3]) -> f32 {
        if self.alike(a, b) {
            return 0.0;
        }
        let blocks = self.blocks(a).zip(self.blocks(b));
        let worst = blocks.fold([0.0; LANES], |worst, (p, q)| {
            self.farther(worst, &carried(&self.motions[p], x), p, q, x)
        });
        worst.into_iter().fold(0.0_f32, f32::max).sqrt()
    }

    #[inline(always)]
    fn farthest(&self, path: &Path, region: usize) -> f32 {
        if self.alike(region, path.region) {
            return 0.0;
        }
        let (p, q) = (path.region * self.num_blocks, region * self.num_blocks);
        let mut worst = [0.0; LANES];
        for (block, places) in path.places.iter().enumerate() {
            worst = self.farther(worst, places, p + block, q + block, path.from);
        }
        let mut farthest = 0.0;
        for square in worst {
            farthest = if square > farthest { square } else { farthest };
        }
        farthest
    }

    /// The squares within one block of key times, where larger than `worst`: `places` is where
    /// block `p` takes `x`, `q` is the other's.
    #[inline(always)]
    fn farther(
        &self,
        mut worst: Lane,
        places: &[Lane; 3],
        p: usize,
        q: usize,
        x: [f32; 3],
    ) -> Lane {
        let others = carried(&self.motions[q], x);
        let mut squares = [0.0_f32; LANES];
        for axis in 0..3 {
            for lane in 0..LANES {
                let d = places[axis][lane] - others[axis][lane];
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

    /// Whether two regions have one motion by what they are.
    #[inline(always)]
    fn alike(&self, a: usize, b: usize) -> bool {
        a == b || (self.still[a] && self.still[b])
    }
}

const STAYS: Block = {
    let mut block = [[[0.0; LANES]; 4]; 3];
    (block[0][0], block[1][1], block[2][2]) = ([1.0; LANES], [1.0; LANES], [1.0; LANES]);
    block
};

#[inline(always)]
fn carried(block: &Block, x: [f32; 3]) -> [Lane; 3] {
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

/// Motions of one neighbourhood at all key times.
#[inline(always)]
fn fit_all(
    regions: &Trajectories,
    turns: &[[f64; 4]],
    stencil: &[(f64, usize)],
    prior: f64,
    blocks: &mut [Block],
) {
    let num_times = regions.num_times();
    for first in (0..num_times).step_by(FITS) {
        let fits = Fits::of(regions, turns, first, stencil);
        let turn = fits.sums.rotation(prior);
        for lane in 0..FITS.min(num_times - first) {
            let k = first + lane;
            fits.write(turn, lane, &mut blocks[k / LANES], k % LANES);
        }
    }
}

/// Fits made at once.
const FITS: usize = 4;

type Times = Lanes<FITS>;

/// Sums of one neighbourhood at a few key times, one lane each.
struct Fits {
    sums: RigidFits<FITS>,
    from: [Times; 3],
    to: [Times; 3],
    /// Key time of each lane.
    times: [usize; FITS],
}

impl Fits {
    /// At key times from `first` on. Beyond the last one, that one again.
    #[inline(always)]
    fn of(
        regions: &Trajectories,
        turns: &[[f64; 4]],
        first: usize,
        stencil: &[(f64, usize)],
    ) -> Self {
        let num_times = regions.num_times();
        let mut times = [num_times - 1; FITS];
        for (lane, time) in times.iter_mut().enumerate() {
            *time = (*time).min(first + lane);
        }
        let (mut from, mut to) = ([Times::ZERO; 3], [Times::ZERO; 3]);
        let mut total = Times::ZERO;
        for &(weight, i) in stencil {
            let weight = present(regions, &times, i, weight);
            let (x, y) = (regions.rest[i].map(Times::all), at_times(regions.places(i), &times));
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
            let weight = present(regions, &times, i, weight);
            sums.add(weight, regions.rest[i].map(Times::all), at_times(regions.places(i), &times));
            sums.add_rotation(weight, at_times(&turns[i * num_times..][..num_times], &times));
        }
        Self { sums, from, to, times }
    }

    #[inline(always)]
    fn write(&self, turn: [Times; 4], lane: usize, block: &mut Block, slot: usize) {
        let of = |values: &[Times; 3]| values.map(|value| value.0[lane]);
        let turn = turn.map(|value| value.0[lane]);
        let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|axis| quat::rotate(turn, axis));
        let turned = quat::rotate(turn, of(&self.from));
        for row in 0..3 {
            for (column, values) in columns.iter().enumerate() {
                block[row][column][slot] = f32::from_double(values[row]);
            }
            block[row][3][slot] = f32::from_double(self.to[row].0[lane] - turned[row]);
        }
    }
}

/// What a neighbour counts at each time. If all have faded, they keep their shares.
#[inline(always)]
fn present(regions: &Trajectories, times: &[usize; FITS], i: usize, weight: f64) -> Times {
    let mut out = Times::all(weight);
    for lane in 0..FITS {
        out.0[lane] *= regions.present(times[lane], i) + FADED;
    }
    out
}

#[inline(always)]
fn at_times<const N: usize>(values: &[[f64; N]], times: &[usize; FITS]) -> [Times; N] {
    let mut out = [Times::ZERO; N];
    for lane in 0..FITS {
        for (out, value) in out.iter_mut().zip(values[times[lane]]) {
            out.0[lane] = value;
        }
    }
    out
}

/// How good own rotations are, 0 to 1, from a sample of neighbourhoods.
///
/// The mean own rotation of a neighbourhood and the one its positions show differ by the errors of
/// both. That of the positions follows from how well they fit; the remainder is what own rotations
/// miss, and the two are weighted by the inverse of their variances.
fn rotation_quality(
    regions: &Trajectories,
    turns: &[[f64; 4]],
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
                let fits = Fits::of(regions, turns, first, &stencil);
                let (shown, own) = (fits.sums.rotation(0.0), fits.sums.rotation(1e6));
                let variance = rotation_variance(regions, &stencil, &fits, shown);
                (0..FITS.min(num_times - first)).map(move |lane| {
                    let [shown, own] = [shown, own].map(|q| q.map(|value| value.0[lane]));
                    let angle = 2.0 * quat::dot(shown, own).abs().min(1.0).acos();
                    [angle * angle, variance.0[lane]]
                })
            })
        })
        .collect();
    let middle = |which: usize| {
        super::numeric::median(&mut compared.iter().map(|c| c[which]).collect::<Vec<_>>())
    };
    let (apart, positions) = (middle(0), middle(1));
    // Below a hundredth of a degree everything agrees.
    let missed = (apart - positions).max(positions / ROTATION_PRIOR).max(3e-8);
    (positions.max(1e-7) / missed / ROTATION_PRIOR).min(1.0)
}

/// Expected square of the angle, radians², by which rotations fitted to the positions alone are
/// wrong.
fn rotation_variance(
    regions: &Trajectories,
    stencil: &[(f64, usize)],
    fits: &Fits,
    turn: [Times; 4],
) -> Times {
    let (mut total, mut squares) = (0.0, 0.0);
    let (mut spread, mut residual) = (Times::ZERO, Times::ZERO);
    for &(weight, i) in stencil {
        let rest = regions.rest[i].map(Times::all);
        let moved = at_times(regions.places(i), &fits.times);
        let expected = fits.sums.apply(turn, rest);
        total += weight;
        squares += weight * weight;
        for a in 0..3 {
            let (arm, miss) = (rest[a] - fits.from[a], moved[a] - expected[a]);
            spread += Times::all(weight) * arm * arm;
            residual += Times::all(weight) * miss * miss;
        }
    }
    let effective: f64 = total * total / squares;
    // Three turns, each across two thirds of the spread; two points' worth of freedom is used up.
    let mut variance = Times::all(1.5) * residual;
    for lane in 0..FITS {
        let value = variance.0[lane] / (spread.0[lane] * (effective - 2.0).max(1.0));
        variance.0[lane] = if value.is_finite() { value } else { 0.0 };
    }
    variance
}
