//! `.ftgs.ply`: 3DGS columns, `time`, `log_duration`, `velocity_0 … velocity_2`, and comments with
//! the settings.

use super::FreeTimeError;
use super::model::{MIN_DURATION, Model, OPACITY_FLOOR};
use crate::error::IoError;
use crate::ply;
use std::path::Path;

const COLUMNS: [&str; 5] = ["time", "log_duration", "velocity_0", "velocity_1", "velocity_2"];
/// Supported version of the comments.
const VERSION: &str = "1";
/// Largest plausible number of frames.
const MAX_FRAMES: usize = 1 << 20;

pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Model, IoError> {
    let wrong = |what: String| IoError::format(path)(FreeTimeError::Settings(what));
    let read = ply::read(bytes).map_err(IoError::format(path))?;
    let setting = |name: &str| {
        let words = |comment: &'_ String| -> Option<String> {
            let (key, value) = comment.trim().split_once(char::is_whitespace)?;
            (key == name).then(|| value.trim().to_owned())
        };
        read.comments.iter().find_map(words)
    };
    match setting("ftgs_version").as_deref() {
        None | Some(VERSION) => {}
        Some(other) => {
            return Err(wrong(format!(
                "has ftgs_version {other}, expected {VERSION}; export it again with the exporter \
                of version {VERSION}"
            )));
        }
    }
    match setting("time_units").as_deref() {
        None | Some("normalized") => {}
        Some(other) => {
            return Err(wrong(format!(
                "has time_units {other}, expected normalized; export it again with normalised times"
            )));
        }
    }
    let number = |name: &str, default: f32| match setting(name) {
        None => Ok(default),
        Some(text) => text
            .parse()
            .ok()
            .filter(|value: &f32| (0.0..=1.0).contains(value))
            .ok_or_else(|| wrong(format!("has {name} {text}, expected a number from 0 to 1"))),
    };
    let (min_duration, opacity_floor) =
        (number("min_duration", MIN_DURATION)?, number("opacity_floor", OPACITY_FLOOR)?);
    let use_velocity = match setting("use_velocity").as_deref() {
        None | Some("1" | "true" | "True") => true,
        Some("0" | "false" | "False") => false,
        Some(other) => return Err(wrong(format!("has use_velocity {other}, expected 0 or 1"))),
    };
    let frames = setting("n_frames").map(|text| {
        let count = text.parse().ok().filter(|count| (1..=MAX_FRAMES).contains(count));
        count.ok_or_else(|| wrong(format!("has n_frames {text}, expected 1 to {MAX_FRAMES}")))
    });
    let columns = ply::read_columns(bytes, &COLUMNS).map_err(IoError::format(path))?;
    let others: Vec<&str> = read
        .extra_columns
        .iter()
        .map(String::as_str)
        .filter(|column| !COLUMNS.contains(column))
        .collect();
    let mut notes = read.notes;
    if !others.is_empty() {
        notes.push(format!("columns not used: {}", others.join(", ")));
    }
    let velocities = (0..read.splats.len()).map(|row| [2, 3, 4].map(|k| columns[k][row])).collect();
    let [times, durations, ..] = columns.try_into().unwrap_or([const { Vec::new() }; 5]);
    Ok(Model {
        splats: read.splats,
        times,
        durations,
        velocities,
        use_velocity,
        min_duration,
        opacity_floor,
        num_frames: frames.transpose()?,
        notes,
    })
}
