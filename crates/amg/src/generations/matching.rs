//! Transport between two generations of splats: which of those that were there before a new splat
//! stands for.

use crate::AmgError;
use crate::rigid::{dot, norm, sub};
use anchors::KdTree;
use rayon::prelude::*;
use uot::{Sinkhorn, SinkhornParams, UotProblem};

/// Candidates of a new splat.
const CANDIDATES: usize = 12;
/// A splat's spacing is the distance of this neighbour.
const SPACING: usize = 3;
/// What it costs to face at right angles, nats.
const FACING: f64 = 3.0;
/// What unlike velocities, colours and sizes cost at most, nats: each alone is worth about two
/// spacings, none decides alone.
const AT_MOST: f64 = 2.0;
/// Difference of colours that is usual on one surface, per channel.
const COLOUR: f64 = 0.15;
/// The same of the logarithm of sizes.
const SIZE: f64 = 0.7;
/// What it costs a new splat to stand for nothing that was there, nats: as much as four spacings.
const UNMATCHED: f64 = 8.0;
/// Weight of the entropy, nats: costs are logarithms of likelihoods.
const ENTROPY: f64 = 1.0;
/// How firmly old splats are to be followed by their share of new ones, nats.
const OLD_SHARES: f64 = 1.0;

/// A splat as transport sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) place: [f64; 3],
    /// What it moves by until its neighbours have changed, world units.
    pub(super) drift: [f64; 3],
    /// Thin axis; its length is the flatness, 0 to 1.
    pub(super) axis: [f64; 3],
    pub(super) ln_size: f64,
    pub(super) colour: [f64; 3],
    /// Share of the mass before it is normalised, above 0.
    pub(super) mass: f64,
}

/// Which old splats a new one stands for, with shares that sum to 1 − `unmatched`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Match {
    pub(super) of: Vec<(u32, f64)>,
    pub(super) unmatched: f64,
}

/// One match per new splat: rows of the transport are old splats, whose marginal is relaxed,
/// columns new ones, whose marginal is held or goes nowhere.
pub(super) fn matches(old: &[Point], new: &[Point]) -> Result<Vec<Match>, AmgError> {
    let nowhere = || Match { of: Vec::new(), unmatched: 1.0 };
    if old.is_empty() || new.is_empty() {
        return Ok(vec![nowhere(); new.len()]);
    }
    let places: Vec<[f64; 3]> = old.iter().map(|point| point.place).collect();
    let tree = KdTree::<3>::new(&places);
    let queries: Vec<[f64; 3]> = new.iter().map(|point| point.place).collect();
    let candidates: Vec<Vec<u32>> =
        tree.map(&queries, CANDIDATES, |_, near| near.iter().map(|n| n.id).collect());
    let mut used: Vec<u32> = candidates.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let asked: Vec<[f64; 3]> = used.iter().map(|&id| places[id as usize]).collect();
    let spacings = tree
        .map(&asked, SPACING + 1, |_, near| near.last().map_or(0.0, |n| n.distance_squared.sqrt()));
    let spacing_of = |id: u32| used.binary_search(&id).map_or(0.0, |at| spacings[at]);
    let costs: Vec<Vec<f64>> = new
        .par_iter()
        .zip(&candidates)
        .map(|(point, ids)| {
            let mut around: Vec<f64> = ids.iter().map(|&id| spacing_of(id)).collect();
            around.sort_by(f64::total_cmp);
            let spacing = around[around.len() / 2].max(f64::MIN_POSITIVE);
            ids.iter().map(|&id| cost(&old[id as usize], point, spacing)).collect()
        })
        .collect();
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); old.len()];
    for ((column, ids), costs) in (0..).zip(&candidates).zip(&costs) {
        for (&id, &cost) in ids.iter().zip(costs) {
            rows[id as usize].push((column, cost));
        }
    }
    let mut starts = vec![0];
    let (mut columns, mut values) = (Vec::new(), Vec::new());
    for row in rows {
        columns.extend(row.iter().map(|entry| entry.0));
        values.extend(row.iter().map(|entry| entry.1));
        starts.push(columns.len());
    }
    let share = |points: &[Point]| -> Vec<f64> {
        let total: f64 = points.iter().map(|point| point.mass).sum();
        points.iter().map(|point| point.mass / total).collect()
    };
    // The plan's reference spreads a column over all rows: "none" is compared with one of them.
    let none = UNMATCHED + (old.len() as f64).ln();
    let problem = UotProblem::from_csr(starts, columns, values, new.len())?
        .with_marginals(share(old), share(new))?
        .with_unmatched_cols(vec![none; new.len()])?;
    let params = SinkhornParams {
        lambda_ent: ENTROPY,
        lambda_a: OLD_SHARES,
        lambda_b: f64::INFINITY,
        tol: 1e-6,
        max_sweeps: 1_000,
        ..SinkhornParams::default()
    };
    let output = Sinkhorn::new(params)?.solve(&problem)?;
    let posterior = output.col_posterior(&problem)?;
    Ok((0..new.len())
        .map(|column| {
            let (ids, shares) = posterior.line(column);
            let of = ids.iter().copied().zip(shares.iter().copied()).collect();
            Match { of, unmatched: posterior.unmatched[column] }
        })
        .collect())
}

/// What it costs `new` to stand for `old`, nats.
fn cost(old: &Point, new: &Point, spacing: f64) -> f64 {
    let apart = sub(new.place, old.place);
    let flat = norm(old.axis);
    // Across a surface is farther than along it.
    let across = dot(old.axis, apart);
    let squared = (dot(apart, apart) + 3.0 * across * across) / (spacing * spacing);
    let facing = flat * norm(new.axis) - dot(old.axis, new.axis).abs();
    let drift = sub(new.drift, old.drift);
    let colour = sub(new.colour, old.colour);
    let at_most = |squared: f64| AT_MOST * (1.0 - (-0.5 * squared / AT_MOST).exp());
    0.5 * squared
        + FACING * facing.max(0.0)
        + at_most(dot(drift, drift) / (spacing * spacing))
        + at_most(dot(colour, colour) / (COLOUR * COLOUR))
        + at_most(((new.ln_size - old.ln_size) / SIZE).powi(2))
}
