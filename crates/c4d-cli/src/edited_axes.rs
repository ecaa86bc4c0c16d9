//! Axes of an edited frame, for formats whose files use different axes (SPZ, glTF).

use crate::args::AxesArg;
use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use amg::{IdentityMap, IdentityParams};
use gs_core::Splats;
use gs_io::frame::Frame;
use std::path::Path;
use std::sync::Arc;

/// Number of splats compared per choice of axes: determines the share
/// to within 2 % in a fraction of a second.
const SAMPLE: usize = 2000;

/// The frame in the requested axes, else in those stated in the file, else in those in which most
/// of its splats match splats of `source`. Reports the choice if it matters.
pub(crate) fn resolve(
    frame: Frame,
    path: &Path,
    source: &Splats,
    chosen: Option<AxesArg>,
    console: &Console,
) -> Outcome<Frame> {
    let Some(reading) = frame.axes else {
        if chosen.is_some() {
            console.warn(format!(
                "{}: --axes does not apply to {}, whose axes are fixed",
                path.display(),
                frame.format
            ));
        }
        return Ok(frame);
    };
    if let Some(chosen) = chosen {
        return Ok(frame.in_axes(chosen.axes()));
    }
    if reading.stated {
        console.detail(format!("{}: the file states its axes as {}", path.display(), reading.axes));
        return Ok(frame);
    }
    let step = frame.splats.len().div_ceil(SAMPLE).max(1);
    let rows: Vec<usize> = (0..frame.splats.len()).step_by(step).collect();
    let precision = frame.precision.as_ref().map(|known| Arc::new(known.select(&rows)));
    let params = IdentityParams { precision, moved: false, ..IdentityParams::default() };
    let sample = Frame {
        splats: frame.splats.select(&rows),
        precision: None,
        notes: Vec::new(),
        comments: Vec::new(),
        ..frame
    };
    let mut best = (0, reading.axes);
    let mut counts = Vec::new();
    for &axes in reading.usual {
        let read = sample.clone().in_axes(axes).splats.with_sh_degree(source.sh_degree);
        let map = IdentityMap::of(source, &read, &params).map_err(|error| {
            Failure::bad_input(format!("{}: {}", path.display(), chain(&error)))
        })?;
        let count = map.unchanged + map.recolored;
        counts.push(format!("{count} as {}", axes.name()));
        if count > best.0 {
            best = (count, axes);
        }
    }
    let of = rows.len();
    if best.0 == 0 {
        let others: Vec<&str> = reading.usual.iter().map(|axes| axes.name()).collect();
        console.warn(format!(
            "{}: the file does not state its axes, and none of its splats matches the scene in \
            any common axes ({}); read as {}. Use --axes to choose",
            path.display(),
            others.join(", "),
            reading.axes
        ));
        return Ok(frame);
    }
    console.note(format!(
        "{}: axes read as {}, in which it matches the scene (of {of} splats compared: {}); use \
        --axes for others",
        path.display(),
        best.1,
        counts.join(", ")
    ));
    Ok(frame.in_axes(best.1))
}
