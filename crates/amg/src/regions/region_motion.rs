//! Rigid motion of each region's surroundings, at each key time.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

use crate::keyframes::FADED;
use crate::rigid::{RigidFit, dot, sub};
use anchors::{RigidNeighbors, Trajectories};
use gs_core::{Real, quat};
use rayon::prelude::*;

/// Weight of the splats' own rotations relative to their positions, if they are as good as any; see [`crate::Aggregation`].
pub(super) const ROTATION_PRIOR: f64 = 3.0;

/// Weights below this share of a neighbour's are left out of fits: rounding.
const NEGLIGIBLE: f64 = 1e-9;

/// Neighbourhoods looked at to tell how good own rotations are.
const SAMPLE: usize = 2000;

/// Key times compared at once.
const LANES: usize = 8;

type Lane = [f32; LANES];

/// Rows of the 3×4 matrices `[R | p]` of one region at eight key times.
type Block = [Lane; 12];

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
        turns: &[Vec<[f64; 4]>],
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
                    for k in 0..num_times {
                        let fit = Fit::of(regions, turns, k, &stencil);
                        fit.write(ROTATION_PRIOR * quality, &mut blocks[k / LANES], k % LANES);
                    }
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

    /// For each of `regions`, the largest square over time of the distance between where it and `path` take the point, as far as
    /// both regions are there. Replaces `out`.
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

    /// Largest distance over time between where regions `a` and `b` take point `x`, as far as both are there.
    pub(super) fn disagreement(&self, a: usize, b: usize, x: [f32; 3]) -> f32 {
        if self.alike(a, b) {
            return 0.0;
        }
        let blocks = self.blocks(a).zip(self.blocks(b));
        let worst = blocks.fold(0.0_f32, |worst, (p, q)| {
            let places = carried(&self.motions[p], x);
            worst.max(self.farthest_in(&places, p, q, x))
        });
        worst.sqrt()
    }

    #[inline(always)]
    fn farthest(&self, path: &Path, region: usize) -> f32 {
        if self.alike(region, path.region) {
            return 0.0;
        }
        let blocks = self.blocks(path.region).zip(self.blocks(region)).zip(&path.places);
        blocks.fold(0.0_f32, |worst, ((p, q), places)| {
            worst.max(self.farthest_in(places, p, q, path.from))
        })
    }

    /// Largest square within one block of key times: `places` is where block `p` takes `x`, `q` is the other's.
    #[inline(always)]
    fn farthest_in(&self, places: &[Lane; 3], p: usize, q: usize, x: [f32; 3]) -> f32 {
        let others = carried(&self.motions[q], x);
        let mut squares = [0.0_f32; LANES];
        for (place, other) in places.iter().zip(&others) {
            for lane in 0..LANES {
                let d = place[lane] - other[lane];
                squares[lane] += d * d;
            }
        }
        if !self.presence.is_empty() {
            for lane in 0..LANES {
                let both = self.presence[p][lane].min(self.presence[q][lane]);
                squares[lane] *= both * both;
            }
        }
        squares.into_iter().fold(0.0_f32, f32::max)
    }

    /// Whether two regions have one motion by what they are.
    #[inline(always)]
    fn alike(&self, a: usize, b: usize) -> bool {
        a == b || (self.still[a] && self.still[b])
    }
}

const STAYS: Block = {
    let mut block = [[0.0; LANES]; 12];
    (block[0], block[5], block[10]) = ([1.0; LANES], [1.0; LANES], [1.0; LANES]);
    block
};

#[inline(always)]
fn carried(block: &Block, x: [f32; 3]) -> [Lane; 3] {
    let mut out = [[0.0; LANES]; 3];
    for (row, out) in block.as_chunks::<4>().0.iter().zip(&mut out) {
        for lane in 0..LANES {
            out[lane] =
                row[0][lane] * x[0] + row[1][lane] * x[1] + row[2][lane] * x[2] + row[3][lane];
        }
    }
    out
}

/// Sums of one neighbourhood at one key time.
struct Fit {
    sums: RigidFit,
    from: [f64; 3],
    to: [f64; 3],
}

impl Fit {
    fn of(
        regions: &Trajectories,
        turns: &[Vec<[f64; 4]>],
        k: usize,
        stencil: &[(f64, usize)],
    ) -> Self {
        let (mut from, mut to, mut total) = ([0.0; 3], [0.0; 3], 0.0);
        // If all have faded, they keep their shares.
        let present = |weight: f64, i: usize| weight * (regions.present(k, i) + FADED);
        for &(weight, i) in stencil {
            let weight = present(weight, i);
            for a in 0..3 {
                from[a] += weight * regions.rest[i][a];
                to[a] += weight * regions.moved[k][i][a];
            }
            total += weight;
        }
        let (from, to) = (from.map(|v| v / total), to.map(|v| v / total));
        let mut sums = RigidFit::about(from, to);
        for &(weight, i) in stencil {
            let weight = present(weight, i);
            sums.add(weight, regions.rest[i], regions.moved[k][i]);
            sums.add_rotation(weight, turns[k][i]);
        }
        Self { sums, from, to }
    }

    fn write(&self, prior: f64, block: &mut Block, lane: usize) {
        let turn = self.sums.rotation(prior);
        let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|axis| quat::rotate(turn, axis));
        let turned = quat::rotate(turn, self.from);
        for row in 0..3 {
            for (column, values) in columns.iter().enumerate() {
                block[4 * row + column][lane] = f32::from_double(values[row]);
            }
            block[4 * row + 3][lane] = f32::from_double(self.to[row] - turned[row]);
        }
    }
}

/// How good own rotations are, 0 to 1, from a sample of neighbourhoods.
///
/// The mean own rotation of a neighbourhood and the one its positions show differ by the errors of both. That of the positions
/// follows from how well they fit; the remainder is what own rotations miss, and the two are weighted by the inverse of their
/// variances.
fn rotation_quality(
    regions: &Trajectories,
    turns: &[Vec<[f64; 4]>],
    outlier: &[bool],
    stencil: &(impl Fn(usize) -> Vec<(f64, usize)> + Sync),
) -> f64 {
    let step = (regions.len() / SAMPLE).max(1);
    let compared: Vec<[f64; 2]> = (0..regions.len())
        .into_par_iter()
        .step_by(step)
        .filter(|&i| !outlier[i])
        .flat_map_iter(|i| {
            let stencil = stencil(i);
            (0..regions.num_times()).map(move |k| {
                let fit = Fit::of(regions, turns, k, &stencil);
                let (shown, own) = (fit.sums.rotation(0.0), fit.sums.rotation(1e6));
                let angle = 2.0 * quat::dot(shown, own).abs().min(1.0).acos();
                [angle * angle, rotation_variance(regions, k, &stencil, &fit, shown)]
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

/// Expected square of the angle, radians², by which a rotation fitted to the positions alone is wrong.
fn rotation_variance(
    regions: &Trajectories,
    k: usize,
    stencil: &[(f64, usize)],
    fit: &Fit,
    turn: [f64; 4],
) -> f64 {
    let (mut total, mut squares, mut spread, mut residual) = (0.0, 0.0, 0.0, 0.0);
    for &(weight, i) in stencil {
        let arm = sub(regions.rest[i], fit.from);
        let miss = sub(regions.moved[k][i], fit.sums.apply(turn, regions.rest[i]));
        total += weight;
        squares += weight * weight;
        spread += weight * dot(arm, arm);
        residual += weight * dot(miss, miss);
    }
    let effective = total * total / squares;
    // Three turns, each across two thirds of the spread; two points' worth of freedom is used up.
    let variance = 1.5 * residual / (spread * (effective - 2.0).max(1.0));
    if variance.is_finite() { variance } else { 0.0 }
}
