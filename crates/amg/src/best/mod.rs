//! The default guide.
//!
//! 1. Source splats that move with none of their neighbours are dropped; the others form cells that move as one.
//! 2. Cells get rigid motions at the key times and outward normals.
//! 3. Each edited splat collects the motions that cells around it would give it.
//! 4. What proves that an edited splat descends from a source splat speaks for that one's motion.
//! 5. How the edit displaced each part's surface is learned from all splats at once, and rates those motions.
//! 6. Neighbours in the edit agree on motion and facing.
//! 7. Splats that no cell explains hang on the nearest ones that some cell does.
//! 8. Large new pieces hang as a whole on what they are attached to.
//! 9. Each takes a few sources of its motion, those most that agree; their weighted rigid motion is its own.

mod cells;
mod cloud;
mod consensus;
mod coverage;
mod edit;
mod graft;
mod graph;
mod modes;
mod motion;
mod offsets;
mod smooth;
mod support;
mod surface;

use crate::binding::RowKind;
use crate::keyframes::KeyFrames;
use crate::options::BestParams;
use crate::pose::Pose;
use crate::propagate::{Progress, Row, Work};
use crate::report::MotionReport;
use crate::rigid::{dot, sub};
use anchors::KdTree;
use cells::Cells;
use cloud::Companions;
use consensus::Consensus;
use edit::Edit;
use gs_core::{Real, Splats};
use motion::CellMotion;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Edge of a cell, share of the figure.
const CELL: f64 = 0.015;

/// Untouched splats this near to an edited one, as a share of the figure, help to decide what it belongs to.
const NEIGHBORHOOD: f64 = 0.1;

/// Motions that differ by less than this share of the figure may support one splat.
const SAME_MOTION: f64 = 0.006;

/// Those that differ by less than this count as one when a splat chooses. A part that bends would else fill all of a splat's few
/// choices with its own variations, and leave none for the part beside it.
const SAME_PART: f64 = 0.015;

/// Cost above which a splat is not explained by any cell near it.
const EXPLAINED: f32 = 4.0;

/// One row per entry of `work.open`, and the factor by which the sources' own rotations may be trusted.
pub(crate) fn bind(
    work: &Work<'_>,
    params: &BestParams,
    report: &mut MotionReport,
    progress: Progress<'_>,
) -> (Vec<Row>, f64) {
    let keys = work.keys;
    let usable = (0..keys.at_edit.len()).filter(|&i| !keys.broken[i]).collect();
    let (ids, pose) = sources(usable, keys, &work.split.dynamic);
    let size = work.split.figure_size;
    if ids.is_empty() || report.num_dynamic == 0 {
        return (vec![(RowKind::Static, Vec::new()); work.open.len()], 1.0);
    }
    let involved = edit::involved(work.edited, &work.open, work.identity, NEIGHBORHOOD * size);
    let mut clock = std::time::Instant::now();
    let mut lap = |name: &'static str, report: &mut MotionReport| {
        report.timings.push((name, clock.elapsed().as_secs_f64()));
        clock = std::time::Instant::now();
    };
    let order = outwards(lexicographic(involved, work.edited, &[]), work.edited, &pose);
    progress("cells", 0.0);
    let cells = Cells::of(keys, ids, &work.split.dynamic, &pose, CELL * size);
    report.num_floaters = cells.num_floaters;
    report.num_parts = cells.members.len();
    if cells.members.is_empty() {
        return (vec![(RowKind::Static, Vec::new()); work.open.len()], 1.0);
    }
    let companions = Companions::of(&cells.cloud);
    let motion = CellMotion::of(&cells.cloud, &companions);
    if motion.floater.iter().all(|&f| f) {
        return (vec![(RowKind::Static, Vec::new()); work.open.len()], 1.0);
    }
    let mut normals = cells.axes.clone();
    surface::orient(&cells.cloud, &companions, &mut normals);
    lap("cells", report);
    progress("choices", 0.0);
    let edit = Edit::of(keys, &cells.ids, work.edited, &order, work.identity, pose.origin);
    let tolerance = |share: f64| (share * size).max(4.0 * companions.noise).as_f32();
    let (links, spacing) = graph::links(&edit.means);
    let (near, mut choices) =
        modes::collect(&cells, &motion, &normals, &edit, tolerance(SAME_PART));
    let survivors = coverage::survivors(&cells, &edit);
    offsets::rate(&cells, &companions, &motion, &mut choices, &survivors, size);
    lap("choices", report);
    progress("smooth", 0.0);
    let chosen = smooth::choose(&motion, &choices, &edit, &links, &spacing, size);
    lap("smooth", report);
    progress("support", 0.0);
    let supports = support::Supports {
        keys,
        cells: &cells,
        motion: &motion,
        spacing: &companions.spacing,
        tolerance: tolerance(SAME_MOTION),
        sources_per_row: params.sources_per_row,
        consensus: Consensus::new(keys, &cells, motion.rotation_trust),
    };
    let reach = f64::from(work.options.reach) * size;
    let within_reach = |e: usize| near[e].distance <= reach;
    let explained = |e: usize| {
        choices[e].get(chosen[e]).is_some_and(|mode| {
            mode.cost[0].min(mode.cost[1]) < EXPLAINED
                && (within_reach(e) || edit.exact[e].is_some())
        })
    };
    let seeds = graph::nearest_seed(&edit.means, &links, explained);
    let grafts = graft::Grafts {
        cells: &cells,
        motion: &motion,
        edit: &edit,
        choices: &choices,
        chosen: &chosen,
        links: &links,
        spacing: &spacing,
        figure_size: size,
        reach,
    };
    let carriers = grafts.carriers(explained);
    let kept: Vec<usize> = (0..cells.cloud.len()).filter(|&i| !motion.floater[i]).collect();
    let points: Vec<[f64; 3]> = kept.iter().map(|&i| cells.cloud.means[i]).collect();
    let tree = KdTree::<3>::new(&points);
    let found: Vec<(Row, bool)> = (0..edit.len())
        .into_par_iter()
        .with_min_len(64)
        .map(|e| {
            if edit.exact[e].is_some() {
                return ((RowKind::Static, Vec::new()), false);
            }
            let sources = match (carriers[e], seeds[e]) {
                (Some(carrier), _) => supports.far(edit.means[e], carrier, &tree, &kept),
                (None, Some(seed)) if seed as usize == e => {
                    supports.near(&edit, e, &choices[e], chosen[e], &near[e].cells)
                }
                (None, Some(seed)) => {
                    let rep = choices[seed as usize][chosen[seed as usize]].cell;
                    supports.far(edit.means[e], rep, &tree, &kept)
                }
                (None, None) if within_reach(e) => {
                    supports.far(edit.means[e], choices[e][chosen[e]].cell, &tree, &kept)
                }
                (None, None) => return ((RowKind::Static, Vec::new()), true),
            };
            let (mut moving, mut total) = (0.0, 0.0);
            for &(id, w) in &sources {
                total += w;
                moving += if work.split.dynamic[id as usize] { w } else { 0.0 };
            }
            let row = if moving * 2.0 > total {
                (RowKind::Blended, sources)
            } else {
                (RowKind::Static, Vec::new())
            };
            (row, false)
        })
        .collect();
    lap("support", report);
    report.out_of_reach = found.iter().filter(|(_, far)| *far).count();
    // Back from canonical order to that of `open`, which is ascending.
    let mut rows = vec![(RowKind::Static, Vec::new()); work.open.len()];
    for (row, (result, _)) in order.iter().zip(found) {
        if let Ok(slot) = work.open.binary_search(row) {
            rows[slot] = result;
        }
    }
    (rows, motion.rotation_trust)
}

/// Usable sources from the inside out, and the frame of those that move.
fn sources(usable: Vec<usize>, keys: &KeyFrames, dynamic: &[bool]) -> (Vec<usize>, Pose) {
    let ids = lexicographic(usable, &keys.at_edit, &keys.means);
    let moving = ids.iter().filter(|&&i| dynamic[i]);
    let pose = Pose::of(&moving.map(|&i| keys.at_edit.means[i].map(f64::from)).collect::<Vec<_>>());
    (outwards(ids, &keys.at_edit, &pose), pose)
}

fn compare(a: &[f32], b: &[f32]) -> Ordering {
    let unlike = a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|order| order.is_ne());
    unlike.unwrap_or(Ordering::Equal)
}

/// Rows in an order that depends on what the splats are, `later` too, not on how the file lists them.
fn lexicographic(mut rows: Vec<usize>, splats: &Splats, later: &[Vec<[f32; 3]>]) -> Vec<usize> {
    rows.par_sort_by(|&a, &b| {
        compare(&splats.means[a], &splats.means[b])
            .then_with(|| compare(&splats.quats[a], &splats.quats[b]))
            .then_with(|| compare(&splats.log_scales[a], &splats.log_scales[b]))
            .then_with(|| splats.opacity_logits[a].total_cmp(&splats.opacity_logits[b]))
            .then_with(|| {
                let mut parted = later.iter().map(|means| compare(&means[a], &means[b]));
                parted.find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
            })
    });
    rows
}

/// Rows by their distance from the origin: an order that a rigid motion or a scale of the scene leaves as it is.
fn outwards(rows: Vec<usize>, splats: &Splats, pose: &Pose) -> Vec<usize> {
    let mut keyed: Vec<(f64, usize)> = rows
        .into_iter()
        .map(|row| {
            let d = sub(splats.means[row].map(f64::from), pose.origin);
            (dot(d, d), row)
        })
        .collect();
    keyed.par_sort_by(|a, b| a.0.total_cmp(&b.0));
    keyed.into_iter().map(|(_, row)| row).collect()
}
