//! How the edit displaced each part of the source's surface, learned from the edit itself.
//!
//! Clothing, swelling and shrinking move a surface along its *outward* normal, much the same everywhere on a body part.
//! So near a contact, where an edited sleeve may lie closer to the trunk than to the arm it belongs to, the offset it
//! would have from either decides: a plain distance cannot. The field is found by alternation: splats choose, the field
//! follows their choices and spreads over cells that move as one, splats choose again.

use super::cells::Cells;
use super::cloud::{Companions, TINY};
use super::coverage;
use super::modes::{Choice, Witness};
use super::motion::CellMotion;
use gs_core::Real;
use rayon::prelude::*;

/// Alternations; more change nothing.
const ROUNDS: usize = 6;

/// Steps of spreading per round, each over the 16 nearest companions.
const SPREAD_STEPS: usize = 5;
const SPREAD_NEIGHBORS: usize = 16;

/// Weight, in splats, of the belief that nothing was displaced.
const PRIOR: f64 = 0.03;

/// Expected misalignment `1 − |cos|` of normals before anything is known, and what is added to the learned one.
const MISALIGNED: f64 = 0.2;
const MISALIGNED_FLOOR: f64 = 0.05;

/// Cost of the typical misalignment.
const ALIGNMENT: f64 = 2.0;

/// Expected squared difference of flatness before anything is known, and what is added to the learned one. Surfaces become surfaces: without this, the blobs inside the next limb, which have
/// no side that could be wrong, explain splats of a sleeve better than the arm in it.
const UNLIKE: f64 = 0.1;
const UNLIKE_FLOOR: f64 = 0.06;

/// Factor on learned standard deviations: choices made so far are biased towards small ones.
const SPREAD: f64 = 1.4;

/// Exponent of the probability with which a splat votes for each of its motions.
const SHARPNESS: f64 = 2.0;

/// Motions that cost this much more than the best one are dropped: no neighbourhood outweighs that.
const HOPELESS: f32 = 10.0;

/// Cost of belonging to a cell that the edit kept as it is: what is still there needs no descendants. An inflated sleeve that comes
/// to lie on a bare hand is told from it by this.
const SURVIVED: f64 = 1.0;

/// Squared offsets, in standard deviations, beyond which more offset costs ever less.
const CAP: f64 = 12.0;

/// Learned statistics per cell.
struct Field {
    /// Mean signed offset, world units.
    mean: Vec<f64>,
    /// Its standard deviation, world units.
    sigma: Vec<f64>,
    /// Typical `1 − |cos|` between normals.
    misaligned: Vec<f64>,
    /// Typical squared difference of flatness.
    unlike: Vec<f64>,
    /// What belonging to the cell costs because of who else does.
    pressure: Vec<f64>,
    /// What it costs because the edit kept its splats.
    survived: Vec<f64>,
}

/// Sets the cost of every mode and sorts each choice, best first. `survivors`, `[N]`: which share of each cell's splats the edit kept.
pub(super) fn rate(
    cells: &Cells,
    companions: &Companions,
    motion: &CellMotion,
    choices: &mut [Choice],
    survivors: &[f64],
    figure_size: f64,
) {
    let graph = spreading_graph(companions, motion);
    let start = first_sigma(companions.typical_spacing(&cells.cloud), choices, figure_size);
    let num = cells.cloud.len();
    let mut field = Field {
        mean: vec![0.0; num],
        sigma: vec![start; num],
        misaligned: vec![MISALIGNED; num],
        unlike: vec![UNLIKE + UNLIKE_FLOOR; num],
        pressure: vec![0.0; num],
        survived: survivors.iter().map(|share| SURVIVED * share).collect(),
    };
    let source: Vec<f64> = cells.members.iter().map(|points| points.len() as f64).collect();
    // The field has far fewer unknowns than there are splats in a large edit.
    let stride = (choices.len() / 20_000).max(1);
    for _ in 0..ROUNDS {
        let votes: Vec<Vote> = choices
            .par_iter()
            .step_by(stride)
            .with_min_len(64)
            .flat_map_iter(|choice| votes(companions, &field, choice))
            .collect();
        follow(&graph, &votes, start, stride as f64, &mut field);
        let edited = counted(&votes, num, stride as f64);
        coverage::update(&graph, &edited, &source, &mut field.pressure);
    }
    choices.par_iter_mut().with_min_len(64).for_each(|choice| {
        let spared = spared(&field, choice);
        for mode in choice.iter_mut() {
            let mut best = f64::INFINITY;
            let mut lowest = [f64::INFINITY; 2];
            for witness in &mode.witnesses {
                let cost = cost(companions, &field, witness, spared);
                lowest = [lowest[0].min(cost[0]), lowest[1].min(cost[1])];
                if cost[0].min(cost[1]) < best {
                    best = cost[0].min(cost[1]);
                    mode.cell = witness.cell;
                }
            }
            mode.cost = lowest.map(|cost| f32::from_double(cost) - mode.descent);
        }
        let least = |mode: &super::modes::Mode| mode.cost[0].min(mode.cost[1]);
        choice.sort_by(|a, b| least(a).total_cmp(&least(b)).then(a.cell.cmp(&b.cell)));
        let best = choice.first().map_or(0.0, least);
        choice.retain(|mode| least(mode) <= best + HOPELESS);
    });
}

fn spreading_graph(companions: &Companions, motion: &CellMotion) -> Vec<Vec<(u32, f64)>> {
    (0..companions.near.len())
        .map(|i| {
            if motion.floater[i] {
                return Vec::new();
            }
            companions.near[i]
                .iter()
                .zip(&companions.agree[i])
                .skip(1)
                .take(SPREAD_NEIGHBORS)
                .filter(|(n, agree)| !motion.floater[n.id as usize] && **agree > 0.05)
                .map(|(n, agree)| (n.id, *agree))
                .collect()
        })
        .collect()
}

/// Upper quartile of the smallest offsets: generous, since the first round must not lock onto wrong parts.
fn first_sigma(spacing: f64, choices: &[Choice], figure_size: f64) -> f64 {
    let smallest = |choice: &Choice| {
        choice
            .iter()
            .flat_map(|mode| &mode.witnesses)
            .map(|w| f64::from(w.offset.abs()))
            .fold(f64::INFINITY, f64::min)
    };
    let mut offsets: Vec<f64> =
        choices.iter().map(smallest).filter(|offset| offset.is_finite()).collect();
    offsets.sort_by(f64::total_cmp);
    let quartile = offsets.get(offsets.len() * 3 / 4).copied().unwrap_or(0.0);
    quartile.min(0.05 * figure_size).max(0.1 * spacing).max(TINY)
}

/// The least of what `survived` costs at any of the splat's cells: where all have survived, it tells nothing.
fn spared(field: &Field, choice: &Choice) -> f64 {
    let witnesses = choice.iter().flat_map(|mode| &mode.witnesses);
    witnesses.map(|w| field.survived[w.cell as usize]).reduce(f64::min).unwrap_or(0.0)
}

/// Cost of the splat belonging to the witness, facing along or against its stored axis: half a squared distance in
/// standard deviations, across and along the surface, plus the misalignment of normals and the difference of flatness in units of the
/// learned ones, plus what the cell costs by itself, less `spared`.
fn cost(companions: &Companions, field: &Field, witness: &Witness, spared: f64) -> [f64; 2] {
    let i = witness.cell as usize;
    let (offset, flat) = (f64::from(witness.offset), f64::from(witness.flat));
    let h = companions.spacing[i];
    let sigma = field.sigma[i].hypot(0.1 * h).max(TINY);
    let tangent = h.hypot(sigma).hypot(field.mean[i]);
    let across = ((offset - field.mean[i]) / sigma).powi(2);
    let across = CAP * (1.0 - (-across / CAP).exp());
    // A ball has no side.
    let ball = (offset / tangent).powi(2);
    let along = f64::from(witness.tangent_squared) / (tangent * tangent);
    let unlike = f64::from(witness.unlike) / field.unlike[i];
    let base = 0.5 * (flat * across + (1.0 - flat) * ball + along + unlike)
        + field.pressure[i]
        + field.survived[i]
        - spared;
    let kappa = ALIGNMENT / field.misaligned[i];
    let aligned = f64::from(witness.aligned);
    [base + kappa * (flat - aligned), base + kappa * (flat + aligned)]
}

/// What a splat says about the field if it belongs to a cell.
struct Vote {
    cell: u32,
    /// How far the splat votes for this one; the shares of a splat sum to 1.
    share: f64,
    /// How much that says about the surface.
    weight: f64,
    /// Signed, along the cell's outward normal, world units.
    offset: f64,
    /// `1 − |cos|` between the normals.
    misaligned: f64,
    /// Squared difference of flatness.
    unlike: f64,
}

/// One vote per mode of the splat, if it counts at all.
fn votes(companions: &Companions, field: &Field, choice: &Choice) -> Vec<Vote> {
    let spared = spared(field, choice);
    let best: Vec<(&Witness, f64)> = choice
        .iter()
        .filter_map(|mode| {
            mode.witnesses
                .iter()
                .map(|w| {
                    let cost = cost(companions, field, w, spared);
                    (w, cost[0].min(cost[1]))
                })
                .min_by(|a, b| a.1.total_cmp(&b.1))
        })
        .collect();
    let lowest = best.iter().fold(f64::INFINITY, |m, b| m.min(b.1));
    let probability = |cost: f64| (SHARPNESS * (lowest - cost)).exp();
    let total: f64 = best.iter().map(|b| probability(b.1)).sum();
    best.iter()
        .map(|&(w, cost)| {
            let flat = f64::from(w.flat);
            let share = probability(cost) / total;
            Vote {
                cell: w.cell,
                share,
                // Splats that nothing explains well, and balls, say little.
                weight: flat * (-0.5 * lowest).exp() * share,
                offset: f64::from(w.offset),
                misaligned: (1.0 - f64::from(w.aligned.abs()) / flat.max(1e-3)).clamp(0.0, 1.0),
                unlike: f64::from(w.unlike),
            }
        })
        .filter(|vote| vote.share > 1e-4)
        .collect()
}

/// Edited splats per cell.
fn counted(votes: &[Vote], cells: usize, scale: f64) -> Vec<f64> {
    let mut edited = vec![0.0; cells];
    for vote in votes {
        edited[vote.cell as usize] += scale * vote.share;
    }
    edited
}

/// Sets the field to what the votes say, spread over companions; `start` is the standard deviation believed in without any.
fn follow(graph: &[Vec<(u32, f64)>], votes: &[Vote], start: f64, scale: f64, field: &mut Field) {
    let mut sums = vec![[0.0_f64; 5]; graph.len()];
    for vote in votes {
        let values = [1.0, vote.offset, vote.offset.powi(2), vote.misaligned, vote.unlike];
        for (sum, value) in sums[vote.cell as usize].iter_mut().zip(values) {
            *sum += scale * vote.weight * value;
        }
    }
    for _ in 0..SPREAD_STEPS {
        sums = (0..sums.len())
            .into_par_iter()
            .with_min_len(512)
            .map(|i| {
                let (mut mean, mut total) = (sums[i], 1.0);
                for &(j, weight) in &graph[i] {
                    for (m, s) in mean.iter_mut().zip(sums[j as usize]) {
                        *m += weight * s;
                    }
                    total += weight;
                }
                mean.map(|m| m / total)
            })
            .collect();
    }
    for (i, [mass, offset, square, misaligned, unlike]) in sums.into_iter().enumerate() {
        let total = mass + PRIOR;
        field.mean[i] = offset / total;
        let variance = (square + PRIOR * start * start) / total - field.mean[i].powi(2);
        field.sigma[i] = SPREAD * variance.max(0.0).sqrt();
        field.misaligned[i] = (misaligned + PRIOR * MISALIGNED) / total + MISALIGNED_FLOOR;
        field.unlike[i] = (unlike + PRIOR * UNLIKE) / total + UNLIKE_FLOOR;
    }
}
