//! Report of a propagation, as text and as JSON.

use crate::args::MotionArg;
use crate::console::Console;
use crate::run_folder::RunConfig;
use crate::settings::PropagateJob;
use amg::{MotionReport, Propagation};
use serde_json::{Value, json};

/// Warns if an edit cannot move, or does not match the frame of which it should be an edit.
pub(super) fn warn_if_static(args: &PropagateJob, propagation: &Propagation, console: &Console) {
    let report = &propagation.report;
    let estimated = report.blended + report.field_rows;
    let moves = |source: u32| propagation.split.dynamic[source as usize];
    let exact = propagation.identity.rows.iter().any(|row| row.source().is_some_and(moves));
    if report.num_dynamic > 0 && estimated == 0 && !exact {
        console.warn(format!(
            "{}: no splat matches a moving splat of the scene, so the result will not move",
            args.edited.display()
        ));
    }
    let kept = propagation.identity.matched();
    if args.motion == MotionArg::Edited && kept * 100 < report.num_edited_splats {
        console.warn(format!(
            "{}: {kept} of {} splats are splats of the scene at time {}. Unless every splat was restyled, it may belong to a different time (--time) or scene",
            args.edited.display(),
            report.num_edited_splats,
            args.time
        ));
    }
}

/// Prints a summary of the motion stage.
pub(super) fn report(report: &MotionReport, motion: MotionArg, seconds: f64, console: &Console) {
    for warning in &report.warnings {
        console.warn(warning);
    }
    if motion == MotionArg::All {
        // Nothing was compared, so the counts of kept splats are meaningless.
        console.note("the motion of every edited splat is estimated (--motion all)");
    } else {
        console.note(format!(
            "{} unchanged (exact), {} recoloured (exact motion), {} edited or new; {} source splats removed",
            report.unchanged, report.recolored, report.edited, report.removed
        ));
    }
    for (count, what) in &report.moved_groups {
        console
            .note(format!("{count} splats moved as a group: {what}; they keep their own motion"));
    }
    if report.near_copies > 0 {
        console.note(format!("{} edited splats next to a copy follow it", report.near_copies));
    }
    console.note(format!(
        "motion of {} edited splats from {} moving source splats in {seconds:.2} s; {} do not move",
        report.blended + report.field_rows,
        report.num_dynamic,
        report.static_rows
    ));
    if let Some(inheritance) = &report.inheritance {
        console.note(format!(
            "the edited frame shows {} of {} splats that are ever visible; {} of the others are matched to these",
            inheritance.shown, inheritance.visible, inheritance.with_ancestors
        ));
        console.note(format!(
            "inherited: {} recoloured, {} removed, {} moved; confidence {:.2}, {} below 0.5",
            inheritance.recolored,
            inheritance.removed,
            inheritance.moved,
            inheritance.confidence,
            inheritance.unsure
        ));
        if inheritance.copied > 0 {
            console.note(format!(
                "{} copies of short-lived splats are visible over the whole clip",
                inheritance.copied
            ));
        }
    }
    for (stage, secs) in &report.timings {
        console.detail(format!("  {stage}: {secs:.3} s"));
    }
}

/// The text about the propagation in the run's page.
pub(super) fn facts(
    config: &RunConfig,
    report: &MotionReport,
    seconds: f64,
) -> Vec<(String, String)> {
    let method = match config.baseline.as_str() {
        "none" => format!("preset {}, motion {}", config.preset, config.motion),
        baseline => format!("baseline {baseline}, motion {}", config.motion),
    };
    [
        ("source", config.source.display().to_string()),
        ("edited", config.edited.display().to_string()),
        ("time of the edit", config.edit_time.to_string()),
        ("method", method),
        ("splats of the source", format!("{}, {} move", report.num_sources, report.num_dynamic)),
        (
            "splats of the edit",
            format!(
                "{}: {} unchanged, {} recoloured, {} moved as groups, {} edited or new",
                report.num_edited_splats,
                report.unchanged,
                report.recolored,
                report.moved,
                report.edited
            ),
        ),
        ("removed", report.removed.to_string()),
        ("motion", format!("{seconds:.2} s")),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

/// `run.json`.
pub(super) fn json(report: &MotionReport, seconds: f64) -> Value {
    let timings: serde_json::Map<String, Value> =
        report.timings.iter().map(|(stage, secs)| ((*stage).to_owned(), json!(secs))).collect();
    json!({
        "schema": 2,
        "motion_seconds": seconds,
        "timings": timings,
        "source": {
            "splats": report.num_sources,
            "moving": report.num_dynamic,
            "floaters": report.num_floaters,
            "non_finite": report.num_broken_sources,
            "dynamic_threshold": report.dynamic_threshold,
            "figure_size": report.figure_size,
            "regions": report.num_regions,
        },
        "edited": {
            "splats": report.num_edited_splats,
            "unchanged": report.unchanged,
            "recoloured": report.recolored,
            "moved": report.moved,
            "moved_groups": report.moved_groups.iter().map(|(splats, what)| json!({
                "splats": splats,
                "transformation": what,
            })).collect::<Vec<_>>(),
            "edited": report.edited,
            "removed": report.removed,
            "blended": report.blended,
            "static": report.static_rows,
            "next_to_copies": report.near_copies,
            "field": report.field_rows,
            "out_of_reach": report.out_of_reach,
            "non_finite": report.broken_rows,
        },
        "inheritance": report.inheritance.as_ref().map(|inheritance| json!({
            "ever_visible": inheritance.visible,
            "visible_in_edit_frame": inheritance.shown,
            "with_ancestors": inheritance.with_ancestors,
            "recoloured": inheritance.recolored,
            "removed": inheritance.removed,
            "moved": inheritance.moved,
            "copied": inheritance.copied,
            "confidence": inheritance.confidence,
            "low_confidence": inheritance.unsure,
            "extended": inheritance.persistent,
        })),
        "anchors": { "source": report.anchors[0], "edited": report.anchors[1], "unmatched": report.unmatched_anchors },
        "transport": report.transport.as_ref().map(|transport| json!({
            "converged": transport.converged,
            "sweeps": transport.sweeps,
            "residual": transport.residual,
            "median_distance": transport.d_med,
            "beta": transport.beta,
            "total_mass": transport.total_mass,
        })),
        "warnings": report.warnings,
    })
}
