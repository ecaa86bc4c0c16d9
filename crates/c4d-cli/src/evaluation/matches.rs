//! Diagnostics of the matches between edited and source splats.

use super::item::Item;
use super::subject::Subject;
use crate::failure::{Failure, Outcome};
use amg::RowKind;
use c4d_metrics::{Match, match_statistics, nearest};
use serde_json::Value;

/// Diagnostics of the binding, and of the transport solver from `report` (`run.json`).
pub(crate) fn matches(subject: &Subject<'_>, report: &Value) -> Outcome<Vec<Item>> {
    let Some(edit) = &subject.edit else {
        let reason = "the scene is not a run: nothing was matched";
        return Ok([
            "match_rows",
            "match_coverage_edit",
            "match_mass",
            "mean_cost",
            "entropy_perplexity",
            "argmax_margin",
            "cross_region_rate",
            "sinkhorn_iters",
            "marginal_residual",
        ]
        .map(|id| Item::missing(id, reason))
        .into());
    };
    let source = subject.source.at(subject.edit_time).map_err(Failure::input)?;
    let kinds = edit.binding.kinds();
    let blended: Vec<usize> =
        (0..kinds.len()).filter(|&row| kinds[row] == RowKind::Blended).collect();
    let placed = |kind: &RowKind| matches!(kind, RowKind::Moved | RowKind::Copied);
    let open = kinds.iter().filter(|kind| !kind.is_exact() && !placed(kind)).count();
    let positions: Vec<[f32; 3]> = blended.iter().map(|&row| edit.frame.means[row]).collect();
    let distance = |a: [f32; 3], b: [f32; 3]| {
        (0..3).map(|k| f64::from(a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
    };
    let near: Vec<f64> = nearest(&positions, &source.means)
        .unwrap_or_default()
        .iter()
        .zip(&positions)
        .map(|(&id, &position)| distance(position, source.means[id as usize]))
        .collect();
    let rows: Vec<Vec<Match>> = blended
        .iter()
        .map(|&row| {
            let (ids, weights) = edit.binding.row(row);
            let position = edit.frame.means[row];
            ids.iter()
                .zip(weights)
                .map(|(&id, &weight)| Match {
                    weight: f64::from(weight),
                    distance: distance(position, source.means[id as usize]),
                })
                .collect()
        })
        .collect();
    let found = match_statistics(&rows, &near);
    let number = |path: &str| report.pointer(path).and_then(Value::as_f64);
    let anchors = number("/anchors/edited").filter(|count| *count > 0.0);
    let coverage = match (anchors, number("/anchors/unmatched")) {
        (Some(anchors), Some(unmatched)) => Some(1.0 - unmatched / anchors),
        _ if open > 0 => Some(blended.len() as f64 / open as f64),
        _ => None,
    };
    let unmatched = "no splat has blended motion";
    let untransported = "the method has no transport";
    let of = |id: &str, value: Option<f64>| Item::optional(id, value, unmatched);
    Ok(vec![
        Item::scalar("match_rows", blended.len() as f64),
        of("match_coverage_edit", coverage)
            .finding("of", if anchors.is_some() { "anchors" } else { "splats" }),
        Item::optional("match_mass", number("/transport/total_mass"), untransported),
        of("mean_cost", found.map(|found| found.mean_distance / subject.radius))
            .with("cost", "distance over the scene's radius")
            .with("radius", subject.radius),
        of("entropy_perplexity", found.map(|found| found.perplexity)),
        of("argmax_margin", found.map(|found| found.argmax_margin)),
        Item::optional(
            "cross_region_rate",
            found.and_then(|found| found.cross_region_rate),
            "most splats with blended motion coincide with a source splat, or there are none",
        ),
        Item::optional("sinkhorn_iters", number("/transport/sweeps"), untransported),
        Item::optional("marginal_residual", number("/transport/residual"), untransported),
    ])
}
