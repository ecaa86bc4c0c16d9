//! Transport between two generations of splats: which earlier splats a new splat replaces.

use crate::AmgError;
use crate::rigid::{dot, norm, sub};
use anchors::KdTree;
use gs_core::nearest_rank;
use rayon::prelude::*;
use uot::{Sinkhorn, SinkhornParams, UotProblem};

/// Number of nearest splats that are candidate predecessors or carriers: about two rings of
/// neighbours on a surface.
pub(crate) const NEIGHBORS: usize = 12;
/// The spacing at a splat is the distance to its n-th nearest neighbour.
const SPACING: usize = 3;
/// Cost of two flat splats at right angles, nats.
pub(crate) const FACING: f64 = 3.0;
/// Maximum cost of a difference in velocity, in colour or in size, nats. Each equals the cost of a
/// distance of two spacings, so that no single difference dominates.
const MAX_DIFFERENCE_COST: f64 = 2.0;
/// Typical difference between colours on one surface, per channel, 0 to 1.
const COLOR: f64 = 0.15;
/// Typical difference between the logarithms of sizes on one surface.
const SIZE: f64 = 0.7;
/// Cost of leaving a new splat unmatched, nats: that of a distance of four spacings.
const UNMATCHED: f64 = 4.0 * MAX_DIFFERENCE_COST;
/// Weights of the entropy and of the marginal of the earlier splats: 1, as costs are negative
/// log-likelihoods in nats.
const WEIGHT: f64 = 1.0;

/// The properties of a splat that determine its cost.
#[derive(Debug, Clone, Copy)]
pub(super) struct MatchFeatures {
    pub(super) position: [f64; 3],
    /// Displacement over half a typical lifetime at its velocity, world units.
    pub(super) drift: [f64; 3],
    /// Thin axis; its length is the flatness, 0 to 1.
    pub(super) axis: [f64; 3],
    pub(super) ln_size: f64,
    pub(super) color: [f64; 3],
    /// Mass before normalisation, above 0.
    pub(super) mass: f64,
}

/// Indices of the earlier splats that a new one replaces, and shares that sum to 1 − `unmatched`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct SplatMatch {
    pub(super) of: Vec<(u32, f64)>,
    pub(super) unmatched: f64,
}

/// One match per new splat. Rows of the transport are the earlier splats, with a relaxed marginal;
/// columns are the new splats, whose mass is transported exactly or left unmatched.
pub(super) fn matches(
    old: &[MatchFeatures],
    new: &[MatchFeatures],
) -> Result<Vec<SplatMatch>, AmgError> {
    let no_match = || SplatMatch { of: Vec::new(), unmatched: 1.0 };
    if old.is_empty() || new.is_empty() {
        return Ok(vec![no_match(); new.len()]);
    }
    let positions: Vec<[f64; 3]> = old.iter().map(|point| point.position).collect();
    let tree = KdTree::<3>::new(&positions);
    let queries: Vec<[f64; 3]> = new.iter().map(|point| point.position).collect();
    let candidates: Vec<Vec<u32>> =
        tree.map(&queries, NEIGHBORS, |_, near| near.iter().map(|n| n.id).collect());
    let mut used: Vec<u32> = candidates.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let queries: Vec<[f64; 3]> = used.iter().map(|&id| positions[id as usize]).collect();
    let spacings = tree.map(&queries, SPACING + 1, |_, near| {
        near.last().map_or(0.0, |n| n.distance_squared.sqrt())
    });
    let spacing_of = |id: u32| used.binary_search(&id).map_or(0.0, |at| spacings[at]);
    let costs: Vec<Vec<f64>> = new
        .par_iter()
        .zip(&candidates)
        .map(|(point, ids)| {
            let mut around: Vec<f64> = ids.iter().map(|&id| spacing_of(id)).collect();
            let spacing = nearest_rank(&mut around, 0.5).unwrap_or(0.0).max(f64::MIN_POSITIVE);
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
    let share = |points: &[MatchFeatures]| -> Vec<f64> {
        let total: f64 = points.iter().map(|point| point.mass).sum();
        points.iter().map(|point| point.mass / total).collect()
    };
    // A column's reference mass is spread over all rows, so that the cost of no match includes
    // ln(rows).
    let none = UNMATCHED + (old.len() as f64).ln();
    let problem = UotProblem::from_csr(starts, columns, values, new.len())?
        .with_marginals(share(old), share(new))?
        .with_unmatched_cols(vec![none; new.len()])?;
    let params = SinkhornParams {
        lambda_ent: WEIGHT,
        lambda_a: WEIGHT,
        lambda_b: f64::INFINITY,
        tol: 1e-6,
        max_sweeps: 1_000,
        ..SinkhornParams::default()
    };
    let output = Sinkhorn::new(params)?.solve(&problem)?;
    let posterior = output.col_posterior(&problem)?;
    Ok((0..new.len())
        .map(|column| {
            let (ids, shares) = posterior.column(column);
            let of = ids.iter().copied().zip(shares.iter().copied()).collect();
            SplatMatch { of, unmatched: posterior.unmatched[column] }
        })
        .collect())
}

/// Cost of `new` replacing `old`, nats.
fn cost(old: &MatchFeatures, new: &MatchFeatures, spacing: f64) -> f64 {
    let apart = sub(new.position, old.position);
    let flat = norm(old.axis);
    // Distances across the surface count double.
    let across = dot(old.axis, apart);
    let squared = (dot(apart, apart) + 3.0 * across * across) / (spacing * spacing);
    let facing = flat * norm(new.axis) - dot(old.axis, new.axis).abs();
    let drift = sub(new.drift, old.drift);
    let color = sub(new.color, old.color);
    let at_most =
        |squared: f64| MAX_DIFFERENCE_COST * (1.0 - (-0.5 * squared / MAX_DIFFERENCE_COST).exp());
    0.5 * squared
        + FACING * facing.max(0.0)
        + at_most(dot(drift, drift) / (spacing * spacing))
        + at_most(dot(color, color) / (COLOR * COLOR))
        + at_most(((new.ln_size - old.ln_size) / SIZE).powi(2))
}
