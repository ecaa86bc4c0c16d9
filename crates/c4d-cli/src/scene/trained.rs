//! Opening trained scenes of the methods that share one reader interface, `gs_io::open_source`.

use super::repaired::say_repair;
use super::{Opened, UP_CAPTURED, bad_input};
use crate::args::Global;
use crate::console::Console;
use crate::failure::Outcome;
use crate::model_flags::source_options;
use crate::passes::Mask;
use gs_io::SceneKind;
use std::path::Path;
use std::sync::Arc;

/// Opens a scene of a kind for which [`SceneKind::is_source`] holds.
pub(crate) fn open(
    path: &Path,
    kind: SceneKind,
    global: &Global,
    console: &Console,
) -> Outcome<Opened> {
    let options = source_options(global, &kind)?;
    let source = gs_io::open_source(path, &kind, &options).map_err(|error| bad_input(&error))?;
    for warning in &source.warnings {
        console.warn(format!("{}: {warning}", path.display()));
    }
    for note in &source.notes {
        console.note(format!("{}: {note}", path.display()));
    }
    say_repair(path, source.repair, global, console);
    Ok(Opened {
        edit_time: source.scene.time_range().start,
        scene: Arc::from(source.scene),
        network: None,
        kind,
        path: path.to_owned(),
        original: None,
        up: source.up.unwrap_or(UP_CAPTURED),
        fps: None,
        background: source.background.unwrap_or([0.0; 3]),
        mask: Mask::default(),
        source_rows: None,
        facts: source.facts,
        roots: vec![path.to_owned()],
        files: source.files,
    })
}
