//! Tables that compare methods.

use super::item::Item;
use super::ranking::best;
use super::table::number;
use c4d_metrics::Better;
use std::fmt::Write as _;

/// Metrics that tables of methods show by default.
pub(crate) const SHOWN: [&str; 23] = [
    "psnr",
    "ssim",
    "flip",
    "bg_psnr",
    "bg_changed_frac",
    "edit_strength",
    "edit_fade",
    "first_frame_psnr",
    "warp_error_ratio",
    "warp_error_own_ratio",
    "warp_error_long_ratio",
    "flicker_excess",
    "static_flicker_excess",
    "motion_fidelity",
    "motion_fidelity_edit",
    "jitter_ratio",
    "drift",
    "isometry_excess",
    "ndd_edit",
    "ndd_excess",
    "scale_blowup",
    "cross_region_rate",
    "time_total",
];

/// A Markdown table with a column per method and the best value of each row in bold; rows without
/// values are omitted.
pub(crate) fn method_table(corner: &str, columns: &[(&str, Vec<Item>)], rows: &[&str]) -> String {
    let titles: Vec<&str> = columns.iter().map(|(title, _)| *title).collect();
    let mut text =
        format!("| {corner} | {} |\n|---|{}", titles.join(" | "), "---|".repeat(titles.len()));
    for id in rows {
        let items: Vec<Option<&Item>> = columns
            .iter()
            .map(|(_, items)| items.iter().find(|item| item.definition.id == *id))
            .collect();
        let values: Vec<Option<f64>> =
            items.iter().map(|item| item.and_then(|item| item.value)).collect();
        let Some(definition) = items.iter().flatten().next().map(|item| item.definition) else {
            continue;
        };
        if values.iter().all(Option::is_none) {
            continue;
        }
        let bold = best(definition.better, &values);
        let arrow = if definition.better == Better::Neither {
            String::new()
        } else {
            format!(" {}", definition.better.arrow())
        };
        let cells: Vec<String> = values
            .iter()
            .enumerate()
            .map(|(k, value)| match value {
                Some(value) if bold.contains(&k) => format!("**{}**", number(*value)),
                Some(value) => number(*value),
                None => "–".to_owned(),
            })
            .collect();
        let _ = write!(text, "\n| `{id}`{arrow} | {} |", cells.join(" | "));
    }
    text
}
