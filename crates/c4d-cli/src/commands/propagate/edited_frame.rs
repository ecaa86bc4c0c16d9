//! Reading the edited frame.

use crate::args::Global;
use crate::console::Console;
use crate::edited_axes;
use crate::failure::{Failure, Outcome, chain};
use crate::model_flags::damage;
use crate::scene;
use crate::settings::PropagateJob;
use crate::suggestion::{self, Needed};
use gs_core::{Precision, Splats};
use gs_io::ply::comments;
use std::sync::Arc;

/// Reads the edited frame, repairs it if possible, and converts it to the scene's SH degree; also
/// returns the precision of its format.
pub(super) fn read(
    args: &PropagateJob,
    source: &Splats,
    global: &Global,
    console: &Console,
) -> Outcome<(Splats, Option<Arc<Precision>>)> {
    let (path, time, sh_degree) = (args.edited.as_path(), args.time, source.sh_degree);
    let frame = gs_io::frame::read_file(path).map_err(|error| {
        let failure = scene::bad_input(&error);
        match suggestion::for_path(path, Needed::Frame).filter(|_| path.is_dir()) {
            Some(next) => failure.next(next),
            None => failure,
        }
    })?;
    let file = gs_io::frame::file_of(path);
    if file != path {
        console.note(format!("{}: the frame is {}", path.display(), file.display()));
    }
    let noted = frame
        .comments
        .iter()
        .find_map(|comment| comment.strip_prefix(comments::TIME)?.trim().parse::<f32>().ok());
    if let Some(noted) = noted
        && (noted - time).abs() > 1e-6
    {
        return Err(Failure::usage(format!(
            "{} was frozen at time {noted}, not at --time {time}",
            path.display()
        ))
        .next(format!("Run again with --time {noted}.")));
    }
    for note in &frame.notes {
        console.note(format!("{}: {note}", path.display()));
    }
    if frame.precision.is_some() {
        console.note(format!(
            "{} ({}) stores rounded values: splats that match the scene within the rounding get the scene's exact values",
            path.display(),
            frame.format
        ));
    }
    let frame = edited_axes::resolve(frame, path, source, args.axes, console)?;
    let rows = frame.splats.len();
    let (frame, damaged) = frame.sanitize(damage(global)).map_err(|error| {
        Failure::bad_input(format!("{}: {}", path.display(), chain(&error))).next(
            if global.strict {
                "Without --strict such rows are dropped and counted."
            } else {
                "Export the edited frame again; c4d info FILE shows its contents."
            },
        )
    })?;
    if let Some(note) = damaged.infinities.note() {
        console.note(format!("{}: {note}", path.display()));
    }
    if frame.splats.len() < rows {
        console.warn(format!(
            "{}: dropped {} of {} rows ({} not finite, {} with a zero quaternion)",
            path.display(),
            damaged.not_finite + damaged.zero_quaternion,
            damaged.rows,
            damaged.not_finite,
            damaged.zero_quaternion
        ));
    }
    let (splats, precision) = (frame.splats, frame.precision);
    if splats.is_empty() {
        return Err(Failure::bad_input(format!("{}: no usable splats", path.display()))
            .next("Export the edited frame again; c4d info FILE shows its contents."));
    }
    if splats.sh_degree == sh_degree {
        return Ok((splats, precision));
    }
    let verb = if splats.sh_degree < sh_degree { "padded with zeros" } else { "cut" };
    console.warn(format!(
        "{}: SH degree {} {verb} to the scene's {sh_degree}{}",
        path.display(),
        splats.sh_degree,
        if precision.is_some() { "; unchanged splats keep theirs" } else { "" }
    ));
    Ok((splats.with_sh_degree(sh_degree), precision))
}
