//! Times and sizes of a run. Times are those recorded when the run was made, because new
//! measurements would depend on the machine.

use super::item::Item;
use super::subject::Subject;
use serde_json::Value;

/// Consecutive stages of a refinement; the other recorded times overlap with these.
const REFINING: [&str; 3] = ["images", "cache", "solve"];

/// Times of `run` (`run.json`) and `refine` (`refine.json`), and sizes.
pub(crate) fn cost(
    subject: &Subject<'_>,
    run: &Value,
    refine: &Value,
    bytes: Option<u64>,
) -> Vec<Item> {
    let number = |report: &Value, name: &str| report.get(name).and_then(Value::as_f64);
    let motion = number(run, "motion_seconds");
    let stage = |report: &Value, name: &str| number(report.get("timings")?, name);
    let parts: Vec<f64> = REFINING.iter().filter_map(|name| stage(refine, name)).collect();
    let refined = (!parts.is_empty()).then(|| parts.iter().sum::<f64>());
    let unrecorded = "not recorded by the run";
    let unrefined = "the run is not refined, or its refinement used no images";
    let total = motion.map(|motion| motion + refined.unwrap_or(0.0));
    vec![
        Item::optional("time_total", total, unrecorded),
        Item::optional("time_motion", motion, unrecorded)
            .finding("stages", run.get("timings").cloned().unwrap_or_default()),
        Item::optional("time_identity", stage(run, "identity"), unrecorded),
        Item::optional("time_match", stage(run, "match"), unrecorded),
        Item::optional("time_cuar", refined, unrefined)
            .finding("stages", refine.get("timings").cloned().unwrap_or_default()),
        Item::optional("time_cuar_images", stage(refine, "images"), unrefined),
        Item::scalar("splats", subject.scene.num_splats() as f64),
        Item::scalar("splats_src", subject.source.num_splats() as f64),
        Item::optional("bytes_run", bytes.map(|bytes| bytes as f64), "the scene is not a run"),
    ]
}
