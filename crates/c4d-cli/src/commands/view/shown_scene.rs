//! [`ShownScene`]: a scene that is served, with everything that the page requests about it.

use super::description::Descriptions;
use crate::args::{Global, OverlayArg, ViewArgs};
use crate::commands::export::page_failure;
use crate::console::Console;
use crate::device::Device;
use crate::evidence::evidence;
use crate::failure::{Failure, Outcome};
use crate::memory;
use crate::overlays::LayerSource;
use crate::scene::LoadedScene;
use gs_core::DynamicScene;
use gs_player::{Annotations, EncodeOptions, Encoded, Overlay};
use std::path::{Path, PathBuf};

/// A scene, encoded.
#[derive(Debug)]
pub(super) struct ShownScene {
    pub(super) opened: LoadedScene,
    /// Whether the scene before the edit is also shown.
    pub(super) has_before: bool,
    pub(super) times: Vec<f32>,
    pub(super) encoded: Encoded,
    pub(super) descriptions: Descriptions,
}

impl ShownScene {
    /// Encodes a scene with `frames` frames.
    pub(super) fn encode(
        opened: LoadedScene,
        frames: usize,
        args: &ViewArgs,
        global: &Global,
        console: &Console,
    ) -> Outcome<Self> {
        memory::require_frames(opened.scene.as_ref(), memory::FRAMES_PACKED)?;
        let has_before = args.scenes.len() == 1 && opened.original.is_some();
        let times = opened.scene.time_range().frames(frames);
        let mut layers = LayerSource::new(&opened);
        let mut overlays = Vec::new();
        let xi = if args.overlay.contains(&OverlayArg::Uncertainty) && opened.binding.is_some() {
            evidence(&opened, &Device::open(global.gpu)?)?
        } else {
            Vec::new()
        };
        for kind in kinds(args, &opened) {
            let overlay = layers.layer(kind, &xi, console)?.overlay;
            overlays.push(if has_before { overlay } else { of_scene_alone(overlay) });
        }
        let descriptions = Descriptions::of(&opened, &mut layers, console)?;
        let scene = opened.scene.as_ref();
        let (first, second): (&dyn DynamicScene, _) = match &opened.original {
            Some(original) if has_before => (original.as_ref(), Some(scene)),
            _ => (scene, None),
        };
        let degree = args.sh_degree.unwrap_or(EncodeOptions::default().sh_degree);
        let options = EncodeOptions { sh_degree: degree, ..EncodeOptions::default() };
        let annotations = Annotations { overlays: &overlays, row_numbers: true };
        let steps = 2 * (1 + u64::from(has_before)) * frames as u64;
        let mut progress = console.progress("encode", steps);
        let mut step = |done: usize, _| progress.set(done as u64);
        let encoded =
            gs_player::encode_annotated(first, second, &times, &options, &annotations, &mut step)
                .map_err(|error| page_failure(&error))?;
        progress.finish();
        Ok(Self { opened, has_before, times, encoded, descriptions })
    }

    /// Path of the scene, as it was given.
    pub(super) fn path(&self) -> &PathBuf {
        &self.opened.path
    }

    /// Path of the scene before the edit, or of the scene itself.
    pub(super) fn path_of(&self, before: bool) -> &PathBuf {
        let source = self.opened.roots.get(1).filter(|_| before && self.has_before);
        source.unwrap_or(&self.opened.path)
    }
}

/// The overlays of a scene: the requested ones that apply, else all except uncertainty.
fn kinds(args: &ViewArgs, opened: &LoadedScene) -> Vec<OverlayArg> {
    let applies = |kind: &OverlayArg| {
        if kind.needs_run() { opened.binding.is_some() } else { !opened.kind.is_frame() }
    };
    let requested = if args.overlay.is_empty() {
        OverlayArg::ALL.into_iter().filter(|kind| *kind != OverlayArg::Uncertainty).collect()
    } else {
        args.overlay.clone()
    };
    requested.into_iter().filter(applies).collect()
}

/// The overlay of a run that is shown without its source.
fn of_scene_alone(mut overlay: Overlay) -> Overlay {
    if !overlay.entries[1].is_empty() {
        overlay.entries = [std::mem::take(&mut overlay.entries[1]), Vec::new()];
    }
    overlay
}

/// Refuses a missing path, before other scenes are loaded.
pub(super) fn check_exists(path: &Path) -> Outcome {
    if path.exists() {
        return Ok(());
    }
    Err(Failure::bad_input(format!("{} does not exist", path.display()))
        .next("Check the name; --watch waits for a scene that does not exist yet."))
}
