//! What a refinement did, in words and as JSON.

use crate::console::Console;
use cuar::{RefineOptions, RepairCounts, Report};
use gs_core::Camera;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// What can be done where no colour changes.
pub(super) const OTHER_VIEWS: &str = "; other views are given with --refine-cameras, more times with --refine-frames, and --preset paper has no \
     threshold";

/// Says what frame 1 does not show of the edit, what was repaired, and what was left and why.
pub(super) fn repair(counts: &RepairCounts, options: &RefineOptions, console: &Console) {
    let RepairCounts { hidden, recoloured, faded, undecided, reaches_hidden } = *counts;
    if options.evidence.is_none() {
        return;
    }
    let text = if recoloured + faded > 0 {
        let mut parts = Vec::new();
        if recoloured > 0 {
            parts.push(format!("{recoloured} got the change of colour of the surface around them"));
        }
        if faded > 0 {
            parts.push(format!("{faded} that a deletion missed fade"));
        }
        format!(
            "frame 1 hides {hidden} splats; of those that the edit missed, {}",
            parts.join(" and ")
        )
    } else if reaches_hidden {
        format!(
            "frame 1 hides {hidden} splats; the edit changed hidden ones too, so those that it left are as they should be"
        )
    } else {
        format!(
            "frame 1 hides {hidden} splats; none of them lies on a surface that the edit changed or deleted"
        )
    };
    let left = if undecided > 0 {
        format!(
            "; {undecided} near a change stay as they are: the surface around them does not say what they should be"
        )
    } else {
        String::new()
    };
    console.note(format!("{text}{left}"));
}

/// Says what the images changed.
pub(super) fn refinement(report: &Report, changed: usize, cameras: &[Camera], console: &Console) {
    for warning in &report.warnings {
        console.warn(warning);
    }
    let stats = &report.supervision;
    let share = |part: u64, whole: u64| 100.0 * part as f64 / whole.max(1) as f64;
    if stats.masked > 0 {
        let reasons = stats.reasons();
        console.note(format!(
            "{:.1} % of the edited pixels look like artifacts; frame 1 shows the surface of {:.1} % of them, and the splats of {:.1} %{}{reasons}",
            share(stats.masked, stats.live),
            share(stats.surface, stats.masked),
            share(stats.splat_colors, stats.masked),
            if reasons.is_empty() { "" } else { "; the others have no supervision: " },
        ));
    }
    console.note(format!(
        "{changed} of {} edited splats have new colours, from {} images: loss {:.3e} to {:.3e}",
        report.num_edited,
        report.samples.len(),
        report.loss_before,
        report.loss_after
    ));
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
pub(super) fn json(report: &Report, changed: usize, cameras: &[Camera]) -> Value {
    let at = |list: &[cuar::ViewTime]| {
        list.iter().map(|at| json!([cameras[at.view].name, at.time])).collect::<Vec<_>>()
    };
    let trace: Vec<Value> =
        report.trace.iter().map(|point| json!([point.secs, point.step, point.loss])).collect();
    let timings: serde_json::Map<String, Value> =
        report.timings.iter().map(|(part, secs)| ((*part).to_owned(), json!(secs))).collect();
    let stats = &report.supervision;
    let doubts: serde_json::Map<String, Value> = cuar::Rejection::ALL
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
            "faded": report.repair.faded,
            "undecided": report.repair.undecided,
            "edit_reaches_hidden": report.repair.reaches_hidden,
        },
        "pixels": {
            "edited": stats.live,
            "masked": stats.masked,
            "known_by_surface": stats.surface,
            "known_by_splats": stats.splat_colors,
            "unknown": doubts,
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
