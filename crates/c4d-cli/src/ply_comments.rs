//! Comments of PLY files in which `c4d` notes the time, the upward axis, the frame rate and the
//! background of rendered views.

use crate::args::Up;
use std::path::Path;

/// Starts the comment with the time of the frame.
pub(crate) const TIME_COMMENT: &str = "c4d_time ";
/// Starts the comment with the background of rendered views.
pub(crate) const BACKGROUND_COMMENT: &str = "c4d_background ";
/// Starts the comment with the upward axis.
pub(crate) const UP_COMMENT: &str = "c4d_up ";
/// Starts the comment with the frame rate of a sequence.
pub(crate) const FPS_COMMENT: &str = "c4d_fps ";

/// The upward axis that our own writer notes in a comment.
pub(crate) fn up_of(ply: &Path) -> Option<[f64; 3]> {
    up_axis(&noted(ply, UP_COMMENT)?)
}

/// The direction of an axis by name: `y`, `-z`.
pub(crate) fn up_axis(name: &str) -> Option<[f64; 3]> {
    let axis: Up = clap::ValueEnum::from_str(name.trim(), true).ok()?;
    Some(axis.vector())
}

/// The frame rate that our own writer notes in a comment.
pub(crate) fn fps_of(ply: &Path) -> Option<f64> {
    noted(ply, FPS_COMMENT)?.parse().ok().filter(|&fps: &f64| fps > 0.0 && fps.is_finite())
}

/// What follows `name` in a comment of a PLY, or of the first one of an archive that does not
/// compress.
fn noted(ply: &Path, name: &str) -> Option<String> {
    use std::io::Read;
    let mut head = vec![0; 16 * 1024];
    let read = gs_io::open_file(ply).ok()?.read(&mut head).ok()?;
    let text = String::from_utf8_lossy(&head[..read]).into_owned();
    let value = text
        .lines()
        .take_while(|line| *line != "end_header")
        .find_map(|line| line.strip_prefix("comment ")?.strip_prefix(name))?;
    Some(value.trim().to_owned())
}

/// Comments for a sequence whose world's up is `up`, when it is an axis: ours, and the one that
/// Brush reads where it has a word for it (there `y` means that −y is up).
pub(crate) fn up_comments(up: [f64; 3]) -> Vec<String> {
    let brush = match up {
        [1.0, 0.0, 0.0] => Some("x"),
        [0.0, -1.0, 0.0] => Some("y"),
        [0.0, 0.0, -1.0] => Some("z"),
        _ => None,
    };
    up_comment(up).into_iter().chain(brush.map(|axis| format!("Vertical axis: {axis}"))).collect()
}

fn up_comment(up: [f64; 3]) -> Option<String> {
    [(Up::X, "x"), (Up::Y, "y"), (Up::Z, "z"), (Up::NegX, "-x"), (Up::NegY, "-y"), (Up::NegZ, "-z")]
        .into_iter()
        .find(|(axis, _)| axis.vector() == up)
        .map(|(_, name)| format!("{UP_COMMENT}{name}"))
}
