//! `c4d demo`: all steps on a synthetic scene, without any input.

use super::propagate::{self, Recorded};
use super::refine;
use super::render::{RenderJob, Views, write_sheet};
use crate::args::{DemoArgs, Global, MotionArg, Pass, PresetArg, RefineFlags};
use crate::clip_file;
use crate::console::Console;
use crate::device::Device;
use crate::failure::{Failure, Outcome, chain};
use crate::output::{existing, output_failure};
use crate::run_folder::Checkpoint;
use crate::scene;
use crate::settings::{PropagateJob, Settings};
use gs_core::{Camera, DynamicScene, Splats};
use gs_io::ply::comments;
use gs_io::ply::{self, WriteOptions};
use gs_io::{AtomicDir, Existing, cameras_json, ply_sequence};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, EditedFrame, SynthError, SynthScene};
use std::path::Path;
use std::time::Instant;

/// Number of frames of the PLY sequence used as the source scene.
const SOURCE_FRAMES: usize = 31;
/// Memory per splat, bytes: source and edit in the motion stage, and frames of both.
const BYTES_PER_SPLAT: u64 = 4096;
/// Size of each half of the video, pixels.
const SIZE: (u32, u32) = (560, 640);
/// Length of the video, seconds, and its largest frame rate; more frames make the video longer.
const SECS: f64 = 2.0;
const MAX_FPS: f64 = 60.0;
/// Number of images for the refinement, and their size, pixels: fewer and smaller than usual, so
/// that the demo takes only seconds.
const REFINE_SAMPLES: usize = 40;
const REFINE_SIZE: (u32, u32) = (240, 240);
/// Number of images used by the demo's simulated editor, and their size, pixels.
const PICTURES: usize = 24;
const PICTURE_SIZE: u32 = 320;
/// Output files of this command.
const SOURCE: &str = "source";
const EDITED: &str = "edited.ply";
const RUN: &str = "run";
const CAMERAS: &str = "cameras.json";
#[cfg(feature = "mp4")]
const VIDEO: &str = "before_after.mp4";
#[cfg(not(feature = "mp4"))]
const VIDEO: &str = "before_after.gif";
const SHEET: &str = "contact_sheet.png";

pub(crate) fn run(args: &DemoArgs, global: &Global, console: &Console) -> Outcome {
    if !(2..=10_000).contains(&args.frames) {
        return Err(Failure::usage(format!("--frames {}: expected 2 to 10000", args.frames)));
    }
    crate::memory::require(
        &format!("a scene of {} splats", args.splats),
        (args.splats as u64).saturating_mul(BYTES_PER_SPLAT),
        "Use a smaller --splats.",
    )?;
    let allowed = DemoParams::NUM_SPLATS;
    if !allowed.contains(&args.splats) {
        let (smallest, largest) = (allowed.start(), allowed.end());
        let what = format!("--splats {}: expected {smallest} to {largest}", args.splats);
        return Err(Failure::usage(what));
    }
    let start = Instant::now();
    let folder = AtomicDir::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let root = folder.path();
    let params = DemoParams { num_splats: args.splats, seed: args.seed, ..DemoParams::default() };
    let synthetic = gs_synth::demo(&params).map_err(Failure::usage)?;
    let edit = delivered(&synthetic, args.seed)?;
    let cameras = synthetic.suggested_cameras(SIZE.0, SIZE.1);
    write_inputs(root, &synthetic, &edit, &cameras, console)?;

    let propagate_args = PropagateJob {
        scene: root.join(SOURCE),
        edited: root.join(EDITED),
        output: root.join(RUN),
        time: 0.0,
        axes: None,
        no_refine: true,
        preset: PresetArg::Default,
        baseline: None,
        motion: MotionArg::Edited,
        follow: None,
        seed: args.seed,
        allow_far: false,
        dry_run: false,
        align: false,
        keep_rest: false,
        refine: RefineFlags::default(),
        settings: Settings::default(),
    };
    let recorded = Recorded { scene: args.output.join(SOURCE), edited: args.output.join(EDITED) };
    let global = Global { overwrite: false, iteration: None, set: Vec::new(), ..global.clone() };
    propagate::propagate(&propagate_args, &recorded, &global, console)?;
    let flags = RefineFlags {
        samples: Some(REFINE_SAMPLES),
        refine_size: Some(REFINE_SIZE),
        ..RefineFlags::default()
    };
    let begun = Checkpoint::new(PresetArg::Default, Settings::default().refine(), &flags);
    refine::refine(&root.join(RUN), begun, &global, console)?;

    let opened = scene::open(&root.join(RUN), &global, console)?;
    let times = opened.scene.time_range().frames(args.frames);
    let error = gs_synth::motion_error(opened.scene.as_ref(), &edit.truth, &times)
        .map_err(Failure::failed)?;
    console.note(format!(
        "ground-truth motion is available: mean error {:.2} % of the figure's size over {} edited splats, 95th percentile {:.2} %",
        error.epe, error.num_scored, error.p95
    ));
    let front: Vec<Camera> = cameras.into_iter().take(1).collect();
    let job = RenderJob {
        scene: opened.scene.as_ref(),
        edit_time: opened.edit_time,
        mask: opened.mask,
        evidence: &[],
        layers: &[],
        original: opened.original.as_deref(),
        times: &times,
        views: &Views::Fixed(front),
        share: None,
        background: [0.0; 3],
        device: &Device::open(global.gpu)?,
        console,
    };
    let fps = (args.frames as f64 / SECS).min(MAX_FPS);
    clip_file::write_playable((&root.join(VIDEO), Existing::Refuse), fps, |push| {
        job.render(|exposure| push(&exposure.image(Pass::Rgb)))
    })?;
    write_sheet((&root.join(SHEET), Existing::Refuse), &job)?;
    folder.commit().map_err(|error| output_failure(&error))?;

    console.note(format!(
        "before (left) and after (right), made from scratch in {:.1} s:",
        start.elapsed().as_secs_f64()
    ));
    for name in [VIDEO, SHEET, SOURCE, EDITED, RUN] {
        console.output(&args.output.join(name), &[]);
    }
    Ok(())
}

/// The demo's edit as an editor would make it from images of frame 1: splats hidden in all images
/// keep the scene's colour.
fn delivered(synthetic: &SynthScene, seed: u64) -> Outcome<EditedFrame> {
    let pictures = synthetic.orbit_cameras(PICTURES, PICTURE_SIZE, PICTURE_SIZE);
    let shown = |splats: &Splats| {
        cuar::first_frame_shares(&CpuRasterizer::default(), splats, &pictures)
            .map_err(|error| DemoEditError(chain(&error)))
    };
    let unseen = gs_synth::UnseenColor::Source;
    gs_synth::apply_visible_edits(synthetic, &gs_synth::demo_edits(), seed, unseen, shown)
        .map_err(|DemoEditError(what)| Failure::failed(what))
}

/// Error of making the demo's edit.
struct DemoEditError(String);

impl From<SynthError> for DemoEditError {
    fn from(error: SynthError) -> Self {
        Self(chain(&error))
    }
}

fn write_inputs(
    root: &Path,
    synthetic: &SynthScene,
    edit: &EditedFrame,
    cameras: &[Camera],
    console: &Console,
) -> Outcome {
    let times = synthetic.time_range().frames(SOURCE_FRAMES);
    let options = WriteOptions {
        normals: false,
        comments: comments::up_comments([0.0, 1.0, 0.0]),
        ..WriteOptions::default()
    };
    let mut progress = console.progress("source", SOURCE_FRAMES as u64);
    ply_sequence::write_folder(
        &root.join(SOURCE),
        synthetic,
        &times,
        &options,
        Existing::Refuse,
        &mut |done| progress.set(done as u64),
    )
    .map_err(|error| output_failure(&error))?;
    progress.finish();
    ply::write_file(&root.join(EDITED), &edit.splats, &options, Existing::Refuse)
        .map_err(|error| output_failure(&error))?;
    cameras_json::write_file(&root.join(CAMERAS), cameras, Existing::Refuse)
        .map_err(|error| output_failure(&error))
}
