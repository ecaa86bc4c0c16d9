//! Opens one frame, such as an editor's output, as a static scene, to render it.

use crate::args::{AxesArg, Global, RenderArgs};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::model_flags::damage;
use crate::scene::{self, LoadedScene};
use gs_io::{OpenOptions, SceneKind};
use std::path::Path;

/// Opens a single frame, or any scene.
pub(crate) fn open(
    path: &Path,
    axes: Option<AxesArg>,
    global: &Global,
    console: &Console,
) -> Outcome<LoadedScene> {
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
    if axes.is_some() && !matches!(kind, SceneKind::Spz | SceneKind::Gltf) {
        return Err(Failure::usage(format!(
            "--axes does not apply to a {kind}: its axes are fixed"
        ))
        .next("Omit it; --up sets the upward direction."));
    }
    let mut options = OpenOptions::default();
    options.damage = damage(global);
    options.axes = axes.map(AxesArg::axes);
    scene::open_with(path, &kind, &options, console)
}

/// Default number of frames of a render: one for a static scene with fixed cameras.
pub(crate) fn frames(args: &RenderArgs, opened: &LoadedScene) -> Option<usize> {
    let walked = args.cameras == "orbit" || args.cameras == "spiral";
    (opened.kind.is_frame() && args.times.is_empty() && !walked).then_some(1)
}
