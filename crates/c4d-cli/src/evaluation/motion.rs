//! Metrics of splat motion: smoothness, rigidity, and drift of unedited splats.

use super::item::Item;
use super::subject::Subject;
use crate::failure::{Failure, Outcome, chain};
use c4d_metrics::{
    MotionTrack, NDD_NEIGHBORS, PointNeighbors, deviation_among, drift, isometry, nearest,
};
use gs_core::{DynamicScene, Splats};

/// Maximum number of measured splats; larger sets are sampled evenly.
const MAX_ROWS: usize = 20_000;
/// Growth of an axis, relative to its first length, above which it counts as blown up.
const BLOWN_UP: f32 = 4.0;

/// Measures the motion of splats from the edited frame to `times`.
pub(crate) fn motion(subject: &Subject<'_>, times: &[f32]) -> Outcome<Vec<Item>> {
    let refused = |error: &gs_core::SceneError| Failure::bad_input(chain(error));
    let mut frames = vec![subject.edit_time];
    frames.extend(times.iter().filter(|&&t| t != subject.edit_time));
    let whole = Whole::of(subject.scene, &frames)?;
    let mut items = Vec::new();
    let source = MotionTrack::of(subject.source, &frames).map_err(|error| refused(&error))?;
    let rows = |wanted: &dyn Fn(usize) -> bool| -> Vec<usize> {
        let all: Vec<usize> = (0..whole.track.first().len()).filter(|&row| wanted(row)).collect();
        let step = all.len().div_ceil(MAX_ROWS).max(1);
        all.into_iter().step_by(step).collect()
    };
    let edit = subject.edit.as_ref();
    let touched = edit.filter(|edit| edit.touched.contains(&true));
    // All splats if nothing was edited.
    let edited = rows(&|row| touched.is_none_or(|edit| edit.touched[row]));
    let track = whole.track.select(&edited);
    let near = nearest(track.first(), source.first());
    let counted = |item: Item| item.finding("splats", edited.len()).with("frames", frames.len());
    let none = "the scene has no splats";
    if let Some(near) = near.filter(|_| !edited.is_empty()) {
        let same: Vec<usize> = near.iter().map(|&row| row as usize).collect();
        let of_source = source.select(&same);
        let (a, b) = (track.jitter(subject.radius), of_source.jitter(subject.radius));
        let sized = |item: Item| counted(item).with("radius", subject.radius);
        items.push(sized(Item::scalar("jitter", a)));
        items.push(sized(Item::scalar("jitter_src", b)));
        items.push(sized(Item::optional(
            "jitter_ratio",
            (b > 0.0).then(|| a / b),
            "the source's splats do not accelerate",
        )));
        let around = PointNeighbors::of(track.first(), NDD_NEIGHBORS);
        let with_neighbors = |item: Item| counted(item).with("neighbours", NDD_NEIGHBORS);
        let (a, b) = (isometry(&track, &around), isometry(&of_source, &around));
        let few = "fewer than nine splats were edited, or there is only one frame";
        items.push(with_neighbors(Item::optional("isometry", a, few)));
        items.push(with_neighbors(Item::optional("isometry_src", b, few)));
        let excess = a.zip(b).map(|(a, b)| a - b);
        items.push(with_neighbors(Item::optional("isometry_excess", excess, few)));
        let (a, b) = (deviation_among(&track, &around), deviation_among(&of_source, &around));
        items.push(with_neighbors(Item::scalar("ndd_edit", a)));
        items.push(with_neighbors(Item::scalar("ndd_src", b)));
        items.push(with_neighbors(Item::scalar("ndd_excess", a - b)));
    } else {
        for id in [
            "jitter",
            "jitter_src",
            "jitter_ratio",
            "isometry",
            "isometry_src",
            "isometry_excess",
            "ndd_edit",
            "ndd_src",
            "ndd_excess",
        ] {
            items.push(Item::missing(id, none));
        }
    }
    let ids = ["drift", "drift_median", "drift_p95", "drift_max"];
    let own = |row: usize| edit.and_then(|edit| edit.source_row[row]);
    let kept = rows(&|row| own(row).is_some());
    let truth: Vec<usize> = kept.iter().filter_map(|&row| own(row)).map(|id| id as usize).collect();
    let truth = source.select(&truth);
    if let Some(found) = drift(&whole.track.select(&kept), &truth, subject.radius) {
        let values = [found.mean, found.median, found.p95, found.max];
        for (id, value) in ids.into_iter().zip(values) {
            items.push(
                Item::scalar(id, value)
                    .finding("splats", kept.len())
                    .with("frames", frames.len())
                    .with("radius", subject.radius),
            );
        }
    } else {
        let reason = if edit.is_some() {
            "no edited splat is a source splat, or there is only one frame"
        } else {
            "the scene is not a run: nothing was edited"
        };
        items.extend(ids.map(|id| Item::missing(id, reason)));
    }
    items.push(Item::scalar("scale_blowup", whole.blown_up).with("factor", f64::from(BLOWN_UP)));
    items.push(Item::scalar("nan_count", whole.not_finite as f64));
    Ok(items)
}

/// The splats of a scene at all times.
struct Whole {
    track: MotionTrack,
    /// Share of splats with a blown-up axis.
    blown_up: f64,
    not_finite: usize,
}

impl Whole {
    fn of(scene: &dyn DynamicScene, times: &[f32]) -> Outcome<Self> {
        let mut frames = Vec::new();
        let mut first_scales: Vec<[f32; 3]> = Vec::new();
        let mut blown = Vec::new();
        let mut not_finite = 0;
        let mut splats = Splats::default();
        for &t in times {
            scene
                .geometry_into(t, &mut splats)
                .map_err(|error| Failure::bad_input(chain(&error)))?;
            let finite = |values: &[f32]| values.iter().filter(|value| !value.is_finite()).count();
            not_finite += splats.means.iter().map(|v| finite(v)).sum::<usize>()
                + splats.quats.iter().map(|v| finite(v)).sum::<usize>()
                + splats.log_scales.iter().map(|v| finite(v)).sum::<usize>();
            if first_scales.is_empty() {
                first_scales.clone_from(&splats.log_scales);
                blown = vec![false; first_scales.len()];
            }
            let limit = BLOWN_UP.ln();
            for ((blown, now), first) in blown.iter_mut().zip(&splats.log_scales).zip(&first_scales)
            {
                *blown |= (0..3).any(|k| now[k] - first[k] > limit);
            }
            frames.push(splats.means.clone());
        }
        let count = blown.iter().filter(|blown| **blown).count();
        let blown_up = count as f64 / blown.len().max(1) as f64;
        Ok(Self { track: MotionTrack::from_frames(frames), blown_up, not_finite })
    }
}
