//! Transport between two generations of splats: which earlier splats a new splat replaces.

use crate::AmgError;
use crate::rigid::{dot, norm, sub};
use anchors::KdTree;
use gs_core::nearest_rank;
use rayon::prelude::*;
use uot::{Sinkhorn, SinkhornParams, UotProblem};

/// Nearest splats that are considered as predecessors and as carriers: about two rings of
/// neighbours on a surface.
pub(crate) const NEIGHBORS: usize = 12;
/// The spacing at a splat is the distance to this nearest neighbour.
const SPACING: usize = 3;
/// Cost of two flat splats at right angles, nats.
pub(crate) const FACING: f64 = 3.0;
/// Largest cost of a difference in velocity, in colour or in size, nats. Each equals a distance of
/// two spacings, so that none of them alone decides.
const AT_MOST: f64 = 2.0;
/// Usual difference between colours on one surface, per channel, 0 to 1.
const COLOR: f64 = 0.15;
/// Usual difference between the logarithms of sizes on one surface.
const SIZE: f64 = 0.7;
/// Cost of leaving a new splat unmatched, nats: that of a distance of four spacings.
const UNMATCHED: f64 = 4.0 * AT_MOST;
/// Weights of the entropy and of the marginal of the earlier splats: 1, as costs are negative
/// log-likelihoods in nats.
const WEIGHT: f64 = 1.0;

/// The properties of a splat that determine its cost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) place: [f64; 3],
    /// Displacement over half a life at its velocity, world units.
    pub(super) drift: [f64; 3],
    /// Thin axis; its length is the flatness, 0 to 1.
    pub(super) axis: [f64; 3],
    pub(super) ln_size: f64,
    pub(super) color: [f64; 3],
    /// Mass before normalisation, above 0.
    pub(super) mass: f64,
}

/// The earlier splats that a new one replaces, with shares that sum to 1 − `unmatched`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Match {
    pub(super) of: Vec<(u32, f64)>,
    pub(super) unmatched: f64,
}

/// One match per new splat. Rows of the transport are the earlier splats, with a relaxed marginal;
/// columns are the new splats, whose mass is transported exactly or left unmatched.
pub(super) fn matches(old: &[Point], new: &[Point]) -> Result<Vec<Match>, AmgError> {
    let nowhere = || Match { of: Vec::new(), unmatched: 1.0 };
    if old.is_empty() || new.is_empty() {
        return Ok(vec![nowhere(); new.len()]);
    }
    let places: Vec<[f64; 3]> = old.iter().map(|point| point.place).collect();
    let tree = KdTree::<3>::new(&places);
    let queries: Vec<[f64; 3]> = new.iter().map(|point| point.place).collect();
    let candidates: Vec<Vec<u32>> =
        tree.map(&queries, NEIGHBORS, |_, near| near.iter().map(|n| n.id).collect());
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
    let share = |points: &[Point]| -> Vec<f64> {
        let total: f64 = points.iter().map(|point| point.mass).sum();
        points.iter().map(|point| point.mass / total).collect()
    };
    // A column's reference mass is spread over all rows, so that the cost of no match needs
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
            Match { of, unmatched: posterior.unmatched[column] }
        })
        .collect())
}

/// Cost of `new` replacing `old`, nats.
fn cost(old: &Point, new: &Point, spacing: f64) -> f64 {
    let apart = sub(new.place, old.place);
    let flat = norm(old.axis);
    // Distances across the surface count double.
    let across = dot(old.axis, apart);
    let squared = (dot(apart, apart) + 3.0 * across * across) / (spacing * spacing);
    let facing = flat * norm(new.axis) - dot(old.axis, new.axis).abs();
    let drift = sub(new.drift, old.drift);
    let color = sub(new.color, old.color);
    let at_most = |squared: f64| AT_MOST * (1.0 - (-0.5 * squared / AT_MOST).exp());
    0.5 * squared
        + FACING * facing.max(0.0)
        + at_most(dot(drift, drift) / (spacing * spacing))
        + at_most(dot(color, color) / (COLOR * COLOR))
        + at_most(((new.ln_size - old.ln_size) / SIZE).powi(2))
}
