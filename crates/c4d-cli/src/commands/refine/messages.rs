//! Report of a refinement, as text and as JSON.

use crate::console::Console;
use cuar::{RefineOptions, RefineReport, RepairCounts};
use gs_core::Camera;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Advice if no colour changed.
pub(super) const OTHER_VIEWS: &str = "; --refine-cameras sets other views, --refine-frames more times, and --preset paper has no \
     threshold";

/// One sentence: what was repaired, what was not, and why.
pub(super) fn summary(report: &RefineReport, options: &RefineOptions, changed: usize) -> String {
    let RepairCounts { hidden, recoloured, meaningless, faded, ambiguous, reaches_hidden, .. } =
        report.repair;
    let mut done = Vec::new();
    if recoloured > 0 {
        let before = if meaningless > 0 {
            format!(" ({meaningless} had meaningless colours)")
        } else {
            String::new()
        };
        done.push(format!(
            "{recoloured} splats hidden in frame 1 were recoloured like the surface around them{before}"
        ));
    }
    if faded > 0 {
        done.push(format!("{faded} remnants of a deletion were faded out"));
    }
    let stats = &report.supervision;
    if changed > recoloured || stats.supervised() > 0 {
        done.push(format!(
            "{changed} of {} edited splats were fitted to frame 1, in {} images",
            report.num_edited,
            report.samples.len()
        ));
    }
    let mut left = Vec::new();
    if ambiguous > 0 {
        left.push(format!(
            "{ambiguous} hidden splats near a change, because the surface around them is ambiguous"
        ));
    }
    if reaches_hidden {
        left.push(
            "hidden splats that the edit did not change, because it changed most hidden splats"
                .to_owned(),
        );
    }
    let unknown = stats.masked - stats.supervised();
    if unknown > 0 {
        left.push(format!(
            "{:.1} % of the pixels that look like artifacts, because frame 1 does not show them ({})",
            share(unknown, stats.masked),
            stats.reasons()
        ));
    }
    if options.evidence.is_some() && left.is_empty() && recoloured + faded == 0 {
        left.push(format!(
            "the {hidden} splats hidden in frame 1, because the edit changed none of their surfaces"
        ));
    }
    let done = if done.is_empty() { "nothing was repaired".to_owned() } else { done.join(", ") };
    if left.is_empty() { done } else { format!("{done}; unchanged: {}", left.join(", ")) }
}

fn share(part: u64, whole: u64) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

/// Reports how well the images determine the changed colours.
pub(super) fn refinement(report: &RefineReport, cameras: &[Camera], console: &Console) {
    for warning in &report.warnings {
        console.warn(warning);
    }
    let stats = &report.supervision;
    if stats.masked > 0 {
        console.note(format!(
            "{:.1} % of the edited pixels look like artifacts; frame 1 shows the surface of {:.1} % of them, and the splats of {:.1} %",
            share(stats.masked, stats.live),
            share(stats.surface, stats.masked),
            share(stats.splat_colors, stats.masked),
        ));
    }
    console.note(format!("loss {:.3e} to {:.3e}", report.loss_before, report.loss_after));
    if !report.held_out.is_empty() {
        let names: BTreeSet<&str> =
            report.held_out.iter().map(|at| cameras[at.view].name.as_str()).collect();
        let [then, now] = report.held_out_artifacts;
        console.note(format!(
            "held-out views ({}): artifacts {then:.3e} to {now:.3e}, change elsewhere {:.3e}",
            names.into_iter().collect::<Vec<_>>().join(", "),
            report.held_out_after - now
        ));
    }
    for (part, secs) in &report.timings {
        console.detail(format!("  {part}: {secs:.2} s"));
    }
}

/// `refine.json`.
pub(super) fn json(report: &RefineReport, changed: usize, cameras: &[Camera]) -> Value {
    let at = |list: &[cuar::ViewTime]| {
        list.iter().map(|at| json!([cameras[at.view].name, at.time])).collect::<Vec<_>>()
    };
    let trace: Vec<Value> =
        report.trace.iter().map(|point| json!([point.secs, point.step, point.loss])).collect();
    let timings: serde_json::Map<String, Value> =
        report.timings.iter().map(|(part, secs)| ((*part).to_owned(), json!(secs))).collect();
    let stats = &report.supervision;
    let rejection_counts: serde_json::Map<String, Value> = cuar::Rejection::ALL
        .into_iter()
        .zip(stats.rejections)
        .map(|(rejection, count)| (rejection.name().replace(' ', "_"), json!(count)))
        .collect();
    json!({
        "schema": 2,
        "edited": report.num_edited,
        "changed": changed,
        "visible": report.num_visible,
        "loss": { "before": report.loss_before, "after": report.loss_after },
        "held_out_loss": {
            "before": report.held_out_before,
            "after": report.held_out_after,
            "artifacts_before": report.held_out_artifacts[0],
            "artifacts_after": report.held_out_artifacts[1],
        },
        "repair": {
            "hidden": report.repair.hidden,
            "recoloured": report.repair.recoloured,
            "meaningless": report.repair.meaningless,
            "faded": report.repair.faded,
            "ambiguous": report.repair.ambiguous,
            "edit_reaches_hidden": report.repair.reaches_hidden,
        },
        "pixels": {
            "edited": stats.live,
            "masked": stats.masked,
            "known_by_surface": stats.surface,
            "known_by_splats": stats.splat_colors,
            "unknown": rejection_counts,
        },
        "images_with_threshold_at_floor": report.num_floored,
        "images": at(&report.samples),
        "held_out": at(&report.held_out),
        "trace_secs_step_loss": trace,
        "timings": timings,
        "bytes": report.bytes,
        "warnings": report.warnings,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_lists_repaired_and_unchanged_splats_with_reasons() {
        let options = RefineOptions::default();
        let mut report = RefineReport::default();
        report.num_edited = 50;
        report.repair.hidden = 9;
        let nothing = summary(&report, &options, 0);
        assert!(nothing.starts_with("nothing was repaired; unchanged: the 9 splats"), "{nothing}");
        report.repair.recoloured = 7;
        report.repair.meaningless = 2;
        report.repair.faded = 3;
        report.repair.ambiguous = 4;
        report.supervision.masked = 10;
        report.supervision.surface = 8;
        report.supervision.rejections[4] = 2;
        let all = summary(&report, &options, 20);
        for part in [
            "7 splats hidden in frame 1",
            "2 had meaningless colours",
            "3 remnants of a deletion",
            "20 of 50 edited splats",
            "4 hidden splats near a change",
            "20.0 % of the pixels",
            "hidden in frame 1",
        ] {
            assert!(all.contains(part), "{part}: {all}");
        }
    }
}
