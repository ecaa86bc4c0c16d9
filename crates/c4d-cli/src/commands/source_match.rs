//! Relation of an edited file to the scene: global transformation, time, and missing splats.
//!
//! All decisions are based on the splats that match the scene, before the slow part begins.

use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use crate::frames;
use crate::scene::LoadedScene;
use crate::settings::PropagateJob;
use amg::{Identity, IdentityMap, IdentityParams};
use gs_core::image_formation::ALPHA_THRESHOLD;
use gs_core::{Precision, RowPrecision, Splats, nearest_rank};
use std::collections::HashSet;
use std::sync::Arc;

/// Largest distance between the centres of edit and source, in source
/// sizes; a larger one means a different scene.
const FAR: f64 = 3.0;
/// Largest ratio of the sizes of edit and source, either way; a larger one means other units.
const LARGER: f64 = 50.0;
/// Share of edited rows equal to canonical rows above which the
/// edit was made from the canonical file.
const CANONICAL_SHARE: f64 = 0.5;
/// Share of matching splats, of the edit or of the scene, above which the file is an edit of the
/// scene, regardless of the others.
const SAME_SCENE: f64 = 0.1;
/// Share of matches at a different time above which the edit is of that time.
const SAME_TIME: f64 = 0.5;
/// Number of unmatched rows compared at other times, spread evenly over
/// the file; determines the share to within 4 %.
const SAMPLED_ROWS: usize = 500;
/// Smallest number of unmatched rows for a comparison with other times.
const FEW_ROWS: usize = 20;
/// In an edit of a different time, the numbers of missing and of unmatched splats are similar (the
/// moving ones). Largest difference, as a share.
const EXCHANGED: f64 = 0.2;
/// Largest number of other times examined.
const OTHER_TIMES: usize = 64;
/// Side of the cells for the comparison with other times, as a share of the scene's size.
const CELL: f64 = 0.005;

/// Refuses files that belong to a different scene, time or frame of reference.
/// Returns the edited splats in the scene's frame, with missing splats added if
/// the flags request it, and adapts `params` to them.
pub(crate) fn fit(
    args: &PropagateJob,
    source: &LoadedScene,
    frame: &Splats,
    edited: Splats,
    params: &mut IdentityParams,
    console: &Console,
) -> Outcome<Splats> {
    let mut edited = edited;
    let mut map = compare(frame, &edited, params)?;
    let few = |map: &IdentityMap, edited: &Splats| {
        (map.matched() as f64) < SAME_SCENE * edited.len().min(frame.len()) as f64
    };
    if !args.allow_far && !args.align {
        if few(&map, &edited) {
            refuse_other_scene(args, frame, &edited, &map)?;
        }
        // Tested before moved parts, because at other times the scene's own parts have moved.
        refuse_other_time(args, source, &edited, &map, params, console)?;
    }
    let whole = if args.align { map.whole_file() } else { map.whole_scene() };
    if let Some(group) = whole
        && let Some(placed) = undo(args, frame, &edited, &map, group, params, console)?
    {
        map = compare(frame, &placed, params)?;
        // Undoing the transformation rounds values; matching splats get the scene's exact values.
        edited = map.restore_in_place(frame, &placed);
    } else if args.align {
        console.warn(format!(
            "--align: {} is not a rotated, scaled or translated copy of the scene; nothing to undo",
            args.edited.display()
        ));
    }
    if !args.allow_far {
        refuse_canonical(args, params, source, frame, &edited)?;
        if args.align && few(&map, &edited) {
            refuse_other_scene(args, frame, &edited, &map)?;
        }
    }
    complete(args, frame, edited, &map, params, console)
}

fn compare(frame: &Splats, edited: &Splats, params: &IdentityParams) -> Outcome<IdentityMap> {
    let params = IdentityParams { enabled: true, moved: true, ..params.clone() };
    IdentityMap::of(frame, edited, &params).map_err(|error| Failure::bad_input(chain(&error)))
}

/// The edited splats in the scene's frame; `None` if they are already in it.
fn undo(
    args: &PropagateJob,
    frame: &Splats,
    edited: &Splats,
    map: &IdentityMap,
    group: u32,
    params: &mut IdentityParams,
    console: &Console,
) -> Outcome<Option<Splats>> {
    let similarity = map.similarities[group as usize];
    let Some((centre, size)) = ball_of_most_splats(frame) else { return Ok(None) };
    if similarity.is_negligible(centre, 2.0 * size) {
        return Ok(None);
    }
    let what = similarity.describe(centre, 2.0 * size);
    let file = args.edited.display();
    if args.align {
        let back = similarity.inverse();
        if let Some(precision) = &params.precision {
            params.precision = Some(Arc::new(back.transform_precision(precision, edited.len())));
        }
        console.note(format!(
            "{file} is the scene {what}: this was undone, so the result is in the scene's own frame"
        ));
        return Ok(Some(back.transform(edited)));
    }
    if args.allow_far {
        console.warn(format!("{file} is the scene {what}: the result keeps this"));
        return Ok(None);
    }
    Err(Failure::bad_input(format!(
        "{file} is the scene {what}: {} of its {} splats match the scene after that transformation",
        map.members(group).count(),
        edited.len()
    ))
    .next("--align undoes it, with the result in the scene's own frame; --allow-far keeps it."))
}

/// Refuses an edit of a different time: most splats that do not match the
/// scene at the given time match it at a different time.
fn refuse_other_time(
    args: &PropagateJob,
    source: &LoadedScene,
    edited: &Splats,
    map: &IdentityMap,
    params: &IdentityParams,
    console: &Console,
) -> Outcome {
    let unmatched: Vec<usize> =
        (0..edited.len()).filter(|&row| map.rows[row].in_place().is_none()).collect();
    let (gone, new) = (map.removed.len(), map.edited);
    let exchanged = gone.abs_diff(new) as f64 <= EXCHANGED * gone.max(new) as f64;
    let most = 2 * unmatched.len() > edited.len();
    if unmatched.len() < FEW_ROWS || !(most || exchanged) {
        return Ok(());
    }
    let step = unmatched.len().div_ceil(SAMPLED_ROWS).max(1);
    let rows: Vec<usize> = unmatched.into_iter().step_by(step).collect();
    let sample = edited.select(&rows);
    let cells = Cells::around(&sample);
    let params = IdentityParams {
        enabled: true,
        moved: false,
        precision: params.precision.as_ref().map(|precision| Arc::new(precision.select(&rows))),
        ..params.clone()
    };
    let times = other_times(source, args.time);
    let mut progress = console.progress("other times", times.len() as u64);
    let mut frame = Splats::default();
    for (done, &t) in times.iter().enumerate() {
        source.scene.at_into(t, &mut frame).map_err(Failure::input)?;
        let near = frame.select(&cells.rows_in(&frame));
        let found = IdentityMap::of(&near, &sample, &params)
            .map_err(|error| Failure::bad_input(chain(&error)))?;
        progress.set(done as u64 + 1);
        if (found.matched() as f64) < SAME_TIME * sample.len() as f64 {
            continue;
        }
        progress.finish();
        let of_frames = source.scene.num_frames().and_then(|frames| {
            let range = source.scene.time_range();
            let number = range.frames(frames).iter().position(|&frame| frame == t)?;
            Some(format!(" (frame {} of {frames})", number + 1))
        });
        return Err(Failure::usage(format!(
            "{} is an edit of the scene at time {t}{}, not at --time {}: of {} compared splats \
            that do not match the scene here, {} match it there",
            args.edited.display(),
            of_frames.unwrap_or_default(),
            args.time,
            sample.len(),
            found.matched()
        ))
        .next(format!("Run again with --time {t}.")));
    }
    progress.finish();
    Ok(())
}

/// Grid cells around some splats, so that only nearby splats have to be compared.
struct Cells {
    edge: f64,
    occupied: HashSet<[i64; 3]>,
}

impl Cells {
    fn around(splats: &Splats) -> Self {
        let size = ball_of_most_splats(splats).map_or(1.0, |(_, size)| 2.0 * size);
        let edge = (CELL * size).max(f64::from(f32::MIN_POSITIVE));
        let mut cells = Self { edge, occupied: HashSet::new() };
        for mean in &splats.means {
            let middle = cells.of(*mean);
            for offset in 0..27_i64 {
                let offset_cell = [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1];
                cells.occupied.insert([0, 1, 2].map(|k| middle[k].saturating_add(offset_cell[k])));
            }
        }
        cells
    }

    #[expect(clippy::cast_possible_truncation, reason = "saturates far away from everything")]
    fn of(&self, mean: [f32; 3]) -> [i64; 3] {
        mean.map(|value| (f64::from(value) / self.edge).floor() as i64)
    }

    fn rows_in(&self, splats: &Splats) -> Vec<usize> {
        let inside = |row: &usize| self.occupied.contains(&self.of(splats.means[*row]));
        (0..splats.len()).filter(inside).collect()
    }
}

/// Candidate times of an edit: the scene's frames, or, for continuous
/// scenes, round numbers in order of simplicity.
fn other_times(source: &LoadedScene, given: f32) -> Vec<f32> {
    let range = source.scene.time_range();
    let mut times = if let Some(count) = source.scene.num_frames() {
        let all = range.frames(count);
        let step = all.len().div_ceil(OTHER_TIMES).max(1);
        all.into_iter().step_by(step).collect()
    } else {
        let mut times: Vec<f32> = Vec::new();
        for parts in [1, 2, 4, 10, 20] {
            for t in range.frames(parts + 1) {
                if !times.iter().any(|known| (known - t).abs() < 1e-6) {
                    times.push(t);
                }
            }
        }
        times
    };
    times.retain(|&t| t != given && frames::check(range, t, "--time").is_ok());
    times
}

/// Refuses an edited frame that shares no splat with the source and does not overlap it.
fn refuse_other_scene(
    args: &PropagateJob,
    source: &Splats,
    edited: &Splats,
    map: &IdentityMap,
) -> Outcome {
    let (Some(source_ball), Some(edited_ball)) =
        (ball_of_most_splats(source), ball_of_most_splats(edited))
    else {
        return Ok(());
    };
    let size = source_ball.1.max(f64::MIN_POSITIVE);
    let away = (0..3).map(|k| (source_ball.0[k] - edited_ball.0[k]).powi(2)).sum::<f64>().sqrt();
    let ratio = edited_ball.1 / size;
    // A small object cut out of a scene is an edit of it; a similar number of splats in a tiny
    // space is a scene in other units.
    let shrunk = ratio < 1.0 / LARGER && edited.len() > source.len() / 10;
    let apart = map.matched() == 0 && away > source_ball.1 + edited_ball.1;
    if away < FAR * size && ratio < LARGER && !shrunk && !apart {
        return Ok(());
    }
    Err(Failure::bad_input(format!(
        "{} does not look like an edit of {} at time {}: {} of its {} splats match the scene, its \
        centre is {:.1} scene sizes away and it is {:.2} times as large",
        args.edited.display(),
        args.scene.display(),
        args.time,
        map.matched(),
        edited.len(),
        away / size,
        ratio
    ))
    .next("Edit the PLY that c4d freeze writes, in the same coordinates; --allow-far continues anyway."))
}

/// The PLY inside a model folder is canonical, not a frame: an edit of it would move twice.
fn refuse_canonical(
    args: &PropagateJob,
    identity: &IdentityParams,
    source: &LoadedScene,
    frame: &Splats,
    edited: &Splats,
) -> Outcome {
    let Some(network) = &source.network else { return Ok(()) };
    let canonical = network.canonical();
    // Splats that the network does not move are equal in both, so they are excluded.
    let (still, moved): (Vec<usize>, Vec<usize>) =
        (0..frame.len()).partition(|&row| canonical.means[row] == frame.means[row]);
    let params = IdentityParams { enabled: true, moved: false, ..identity.clone() };
    let found = |cloud: &Splats| -> Outcome<usize> {
        let map = IdentityMap::of(cloud, edited, &params)
            .map_err(|error| Failure::bad_input(chain(&error)))?;
        Ok(map.matched())
    };
    let of_still = if still.is_empty() { 0 } else { found(&frame.select(&still))? };
    let open = edited.len().saturating_sub(of_still);
    if moved.is_empty() || open == 0 {
        return Ok(());
    }
    let share =
        |cloud: &Splats| -> Outcome<f64> { Ok(found(&cloud.select(&moved))? as f64 / open as f64) };
    if share(canonical)? < CANONICAL_SHARE || share(frame)? >= CANONICAL_SHARE {
        return Ok(());
    }
    Err(Failure::bad_input(format!(
        "{} is an edit of the model's own point_cloud.ply, which is canonical and not a frame of the scene",
        args.edited.display()
    ))
    .next(format!("Write the frame with c4d freeze {} -o DIR and edit DIR/point_cloud.ply.", args.scene.display())))
}

/// Adds missing splats that the user did not delete on purpose; reports
/// missing splats, and edits of invisible ones.
fn complete(
    args: &PropagateJob,
    frame: &Splats,
    edited: Splats,
    map: &IdentityMap,
    params: &mut IdentityParams,
    console: &Console,
) -> Outcome<Splats> {
    let (file, time) = (args.edited.display(), args.time);
    if map.matched() == 0 {
        if args.keep_rest {
            return Err(Failure::usage(format!(
                "--keep-rest: no splat of {file} matches the scene at time {time}, so there is nothing to add"
            ))
            .next("Omit --keep-rest, or specify the time at which the selection was saved with \
                  --time."));
        }
        return Ok(edited);
    }
    let (hidden, shown): (Vec<u32>, Vec<u32>) =
        map.removed.iter().partition(|&&id| frame.opacity(id as usize) < ALPHA_THRESHOLD);
    let num_hidden = (0..frame.len()).filter(|&id| frame.opacity(id) < ALPHA_THRESHOLD).count();
    let num_shown = frame.len() - num_hidden;
    let selection_only = 2 * shown.len() > num_shown;
    let left_out = !hidden.is_empty() && hidden.len() == num_hidden && !selection_only;
    let added: &[u32] = if args.keep_rest {
        console.note(format!("--keep-rest: {} splats of the scene added", map.removed.len()));
        &map.removed
    } else if left_out {
        console.note(format!(
            "{num_hidden} splats of the scene that are invisible at time {time} are not in {file} \
            and are kept"
        ));
        &hidden
    } else {
        &[]
    };
    if selection_only && !args.keep_rest {
        console.warn(format!(
            "{file} has {} of the scene's {num_shown} visible splats; the other {} are removed at all times. If only a selection was saved, --keep-rest adds the rest",
            num_shown - shown.len(),
            shown.len()
        ));
    }
    let removed = if added.is_empty() { hidden.len() } else { 0 };
    let unseen = |row: &&Identity| {
        let changed = matches!(row, Identity::Recolored(_) | Identity::Moved { .. });
        changed && row.source().is_some_and(|id| frame.opacity(id as usize) < ALPHA_THRESHOLD)
    };
    let changed = map.rows.iter().filter(unseen).count();
    if changed + removed > 0 {
        console.note(format!(
            "the edit affects splats that are invisible at time {time}: {changed} changed, \
            {removed} removed; the change becomes visible when they appear"
        ));
    }
    Ok(appended(frame, edited, added, params))
}

fn appended(
    frame: &Splats,
    mut edited: Splats,
    added: &[u32],
    params: &mut IdentityParams,
) -> Splats {
    if added.is_empty() {
        return edited;
    }
    if let Some(precision) = &params.precision {
        let stored = (0..edited.len()).map(|row| *precision.of(row));
        let exact = added.iter().map(|_| RowPrecision::EXACT);
        params.precision = Some(Arc::new(Precision::by_chunk(stored.chain(exact).collect(), 1)));
    }
    let rest = frame.with_sh_degree(edited.sh_degree);
    for &id in added {
        edited.push_from(&rest, id as usize);
    }
    edited
}

/// Median centre, and the radius that contains 90 % of the splats, world units. Every splat counts
/// equally, unlike in [`gs_core::Extent`], which weighs splats by size: deleting a backdrop of few
/// large splats must not look like a different scene.
fn ball_of_most_splats(splats: &Splats) -> Option<([f64; 3], f64)> {
    let finite: Vec<[f64; 3]> = splats
        .means
        .iter()
        .filter(|mean| mean.iter().all(|value| value.is_finite()))
        .map(|mean| mean.map(f64::from))
        .collect();
    if finite.is_empty() {
        return None;
    }
    let rank = |mut values: Vec<f64>, share| nearest_rank(&mut values, share).unwrap_or(0.0);
    let centre = [0, 1, 2].map(|k| rank(finite.iter().map(|p| p[k]).collect(), 0.5));
    let distance = |p: &[f64; 3]| (0..3).map(|k| (p[k] - centre[k]).powi(2)).sum::<f64>().sqrt();
    Some((centre, rank(finite.iter().map(distance).collect(), 0.9)))
}
