//! Comments of PLY files in which `c4d` stores the time, the upward axis, the frame rate and the
//! background of rendered views.

use crate::fs::open_file;
use std::io::Read;
use std::path::Path;

/// Prefix of the comment with the time of the frame.
pub const TIME: &str = "c4d_time ";
/// Prefix of the comment with the background of rendered views.
pub const BACKGROUND: &str = "c4d_background ";
/// Prefix of the comment with the upward axis.
pub const UP: &str = "c4d_up ";
/// Prefix of the comment with the frame rate of a sequence.
pub const FPS: &str = "c4d_fps ";

/// Axes of the world by name.
const AXES: [(&str, [f64; 3]); 6] = [
    ("x", [1.0, 0.0, 0.0]),
    ("y", [0.0, 1.0, 0.0]),
    ("z", [0.0, 0.0, 1.0]),
    ("-x", [-1.0, 0.0, 0.0]),
    ("-y", [0.0, -1.0, 0.0]),
    ("-z", [0.0, 0.0, -1.0]),
];

/// Upward direction stated in a PLY, unit vector in the world frame.
pub fn up_of(ply: &Path) -> Option<[f64; 3]> {
    axis(&noted(ply, UP)?)
}

/// Unit vector of an axis by name: `y`, `-z`.
pub fn axis(name: &str) -> Option<[f64; 3]> {
    let name = name.trim().to_ascii_lowercase();
    AXES.into_iter().find(|(known, _)| *known == name).map(|(_, axis)| axis)
}

/// Frames per second stated in a PLY.
pub fn fps_of(ply: &Path) -> Option<f64> {
    noted(ply, FPS)?.parse().ok().filter(|&fps: &f64| fps > 0.0 && fps.is_finite())
}

/// Text after `prefix` in a comment of a PLY, or of the first PLY in an uncompressed archive.
fn noted(ply: &Path, prefix: &str) -> Option<String> {
    let mut head = vec![0; 16 * 1024];
    let read = open_file(ply).ok()?.read(&mut head).ok()?;
    let text = String::from_utf8_lossy(&head[..read]).into_owned();
    let value = text
        .lines()
        .take_while(|line| *line != "end_header")
        .find_map(|line| line.strip_prefix("comment ")?.strip_prefix(prefix))?;
    Some(value.trim().to_owned())
}

/// Comments for a frame whose upward direction `up` is an axis of the world: the one that `c4d`
/// reads, and the one that Brush reads, if it has a name for the axis (there `y` means that −y is
/// up).
pub fn up_comments(up: [f64; 3]) -> Vec<String> {
    let brush = match up {
        [1.0, 0.0, 0.0] => Some("x"),
        [0.0, -1.0, 0.0] => Some("y"),
        [0.0, 0.0, -1.0] => Some("z"),
        _ => None,
    };
    let named = AXES.into_iter().find(|(_, axis)| *axis == up);
    let ours = named.map(|(name, _)| format!("{UP}{name}"));
    ours.into_iter().chain(brush.map(|axis| format!("Vertical axis: {axis}"))).collect()
}
