//! Opens one frame, such as an editor's output, as a static scene, to render it.

use crate::args::{AxesArg, Global, RenderArgs};
use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use crate::model_flags::damage;
use crate::passes::Mask;
use crate::scene::{self, Opened};
use gs_core::DynamicScene;
use gs_deform::StaticScene;
use gs_io::frame;
use gs_io::ply::comments;
use std::path::Path;
use std::sync::Arc;

/// Opens a single frame, or any scene.
pub(crate) fn open(
    path: &Path,
    axes: Option<AxesArg>,
    global: &Global,
    console: &Console,
) -> Outcome<Opened> {
    if !path.exists() {
        return scene::open(path, global, console);
    }
    let kind = gs_io::detect(path).map_err(|error| scene::bad_input(&error))?;
    if !kind.is_frame() {
        if axes.is_some() {
            return Err(Failure::usage("--axes is for a single SPZ or glTF frame").next(
                "Omit it. Sequences of SPZ or glTF frames take --set axes=…; other scenes \
                      have fixed axes.",
            ));
        }
        return scene::open(path, global, console);
    }
    if global.iteration.is_some() || !global.set.is_empty() {
        scene::refuse_model_flags(path, global.iteration)?;
    }
    let mut frame = frame::read_file(path).map_err(|error| scene::bad_input(&error))?;
    match (axes, &frame.axes) {
        (Some(axes), Some(_)) => frame = frame.in_axes(axes.axes()),
        (Some(_), None) => {
            return Err(Failure::usage(format!(
                "--axes does not apply to {}, whose axes are fixed",
                frame.format
            ))
            .next("Omit it; --up sets the upward direction."));
        }
        (None, Some(reading)) => {
            if let Some(assumed) = reading.assumption() {
                console.note(format!(
                    "{}: {assumed}; if it appears upside down, give --axes ply",
                    path.display()
                ));
            }
        }
        (None, None) => {}
    }
    for note in &frame.notes {
        console.note(format!("{}: {note}", path.display()));
    }
    let (frame, damaged) = frame.sanitize(damage(global)).map_err(|error| {
        Failure::bad_input(format!("{}: {}", path.display(), chain(&error)))
            .next("Without --strict such rows are dropped and counted.")
    })?;
    scene::say_repair(path, damaged, global, console);
    if frame.splats.is_empty() {
        return Err(Failure::bad_input(format!("{}: no usable splats", path.display()))
            .next("Export the frame again; c4d info FILE shows its contents."));
    }
    let noted = frame.comments.iter().find_map(|comment| comment.strip_prefix(comments::UP));
    let up = noted.and_then(comments::axis).unwrap_or(scene::UP_CAPTURED);
    let scene = Arc::new(StaticScene::new(frame.splats).map_err(Failure::input)?);
    Ok(Opened {
        edit_time: scene.time_range().start,
        scene,
        network: None,
        kind,
        path: path.to_owned(),
        original: None,
        up,
        fps: None,
        background: [0.0; 3],
        mask: Mask::default(),
        source_rows: None,
        binding: None,
        facts: Vec::new(),
        roots: vec![path.to_owned()],
        files: vec![frame::file_of(path)],
    })
}

/// Default number of frames of a render: one for a static scene with fixed cameras.
pub(crate) fn frames(args: &RenderArgs, opened: &Opened) -> Option<usize> {
    let walked = args.cameras == "orbit" || args.cameras == "spiral";
    (opened.kind.is_frame() && args.times.is_empty() && !walked).then_some(1)
}
