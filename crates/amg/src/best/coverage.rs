//! Which parts of the source's surface have more, or fewer, edited splats than the rest of their body part.
//!
//! Where an edit pushes two surfaces through each other, each lies where the other is expected, and splat by splat both look like
//! one. But then that one has twice its share of splats and the other has none: a surface that is taken explains no second
//! one (what transport does by holding the source's marginal).

use super::cells::Cells;
use super::edit::Edit;
use rayon::prelude::*;

/// Cost per logarithm of the coverage relative to the usual one, and the largest that any coverage can cost or gain.
const STRENGTH: f64 = 2.0;
const LIMIT: f64 = 2.0;

/// Steps of spreading over companions: the patch looked at, and the body part it is compared with.
const PATCH: usize = 3;
const PART: usize = 40;

/// Splats that every cell is believed to have, as a share of its own: parts of which nothing is left are not besieged.
const PRIOR: f64 = 0.3;

/// Share of the old pressure kept from round to round.
const DAMPING: f64 = 0.5;

/// Share of each cell's splats that the edit kept as they are.
pub(super) fn survivors(cells: &Cells, edit: &Edit) -> Vec<f64> {
    let one = |points: &Vec<u32>| {
        points.iter().filter(|&&point| edit.kept[point as usize]).count() as f64
            / points.len() as f64
    };
    cells.members.iter().map(one).collect()
}

/// Updates `pressure` (added to the cost of belonging to a cell) from the number of edited splats per cell, `[N]`, and of source
/// splats.
pub(super) fn update(
    graph: &[Vec<(u32, f64)>],
    edited: &[f64],
    source: &[f64],
    pressure: &mut [f64],
) {
    let mut counts: Vec<[f64; 2]> =
        edited.iter().zip(source).map(|(&edited, &source)| [edited, source]).collect();
    let mut near = Vec::new();
    for step in 0..PART {
        if step == PATCH {
            near.clone_from(&counts);
        }
        counts = spread(graph, &counts);
    }
    for ((pressure, near), wide) in pressure.iter_mut().zip(near).zip(counts) {
        let usual = wide[0] / wide[1].max(1e-9);
        let coverage = (near[0] + PRIOR * usual * near[1]) / ((1.0 + PRIOR) * usual * near[1]);
        let new = if coverage > 0.0 && coverage.is_finite() {
            (STRENGTH * coverage.ln()).clamp(-LIMIT, LIMIT)
        } else {
            0.0
        };
        *pressure = DAMPING * *pressure + (1.0 - DAMPING) * new;
    }
}

fn spread(graph: &[Vec<(u32, f64)>], values: &[[f64; 2]]) -> Vec<[f64; 2]> {
    (0..values.len())
        .into_par_iter()
        .with_min_len(512)
        .map(|i| {
            let (mut sum, mut total) = (values[i], 1.0);
            for &(j, weight) in &graph[i] {
                let value = values[j as usize];
                sum = [sum[0] + weight * value[0], sum[1] + weight * value[1]];
                total += weight;
            }
            sum.map(|v| v / total)
        })
        .collect()
}
