//! `c4d propagate`: propagate an edited frame to all times.

mod edited_frame;
mod messages;
mod run_files;

pub(crate) use run_files::Recorded;

use super::{dry_run, refine, source_match};
use crate::args::{BaselineArg, FollowArg, Global, MotionArg, PresetArg, PropagateArgs};
use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use crate::field::NetworkField;
use crate::lifetimes::Lifetimes;
use crate::output::{existing, output_failure, refuse_overlap};
use crate::run_folder::{self, Checkpoint};
use crate::scene::{self, LoadedScene};
use crate::settings::{PropagateJob, RefineSettings, Settings};
use crate::stages::Stages;
use crate::{frames, memory, placement};
use amg::{Follow, MotionGuide, MotionOptions, MotionPreset};
use gs_core::Extent;
use gs_io::AtomicDir;
use run_files::Finished;
use std::sync::Arc;
use std::time::Instant;

/// Upper bound on the memory of the motion stage per splat of the source and of the edit, bytes
/// (measured: 1.2 KiB, see the benchmarks).
const BYTES_PER_SPLAT: u64 = 1536;
/// Additional memory per splat of the source for `--follow surface`: 65 key times of 16 bytes,
/// and carriers.
const BYTES_PER_LIFETIME: u64 = 2048;

pub(crate) fn run(args: &PropagateArgs, global: &Global, console: &Console) -> Outcome {
    let settings = Settings::read(args.config.as_deref())?;
    let global = &settings.global(global);
    let args = &settings.job(args)?;
    let recorded = Recorded { scene: args.scene.clone(), edited: args.edited.clone() };
    propagate(args, &recorded, global, console)?;
    if args.dry_run {
        return Ok(());
    }
    if !args.no_refine {
        console.note("motion is written; refining colours (after an interruption, c4d refine RUN --resume continues)");
        let (preset, settings) = refinement(args)?;
        let begun = Checkpoint::new(preset, settings, &args.refine);
        refine::refine(&args.output, begun, global, console)?;
    }
    console.note(format!(
        "to view it: c4d render {0} --side-by-side -o clip.mp4; to export it: c4d export {0} --to ply-seq -o frames",
        args.output.display()
    ));
    console.report(|| run_folder::reports(&args.output));
    console.output(&args.output, &[]);
    Ok(())
}

pub(crate) fn propagate(
    args: &PropagateJob,
    recorded: &Recorded,
    global: &Global,
    console: &Console,
) -> Outcome {
    let start = Instant::now();
    let source = scene::open(&args.scene, global, console)?;
    memory::require_frames(source.scene.as_ref(), memory::FRAMES_SEEN)?;
    let mut inputs = source.roots.clone();
    inputs.push(args.edited.clone());
    refuse_overlap(&args.output, &inputs)?;
    if !args.no_refine {
        let (preset, settings) = refinement(args)?;
        refine::check(&args.refine, preset, &settings, global)?;
    }
    frames::check(source.scene.time_range(), args.time, "--time")?;
    let mut options = options(args, &source)?;
    let source_splats = source.scene.at(args.time).map_err(Failure::input)?;
    let (edited, precision) = edited_frame::read(args, &source_splats, global, console)?;
    options.identity.precision = precision;
    let edited =
        source_match::fit(args, &source, &source_splats, edited, &mut options.identity, console)?;
    console.note(format!(
        "source {} splats, edited {} splats, time {}",
        source_splats.len(),
        edited.len(),
        args.time
    ));
    placement::warn_if_coarse(&Extent::of(&source_splats), console);
    let follow = follow(args, &source, console)?;
    options.follow = match follow {
        FollowArg::Splats => Follow::Splats,
        FollowArg::Surface => Follow::Surface,
    };
    if args.dry_run {
        let (before, after) = ((&source, &source_splats), (&edited, &options.identity));
        return dry_run::show(args, before, after, global, console);
    }
    require_memory(source_splats.len(), edited.len(), follow)?;
    // Refuse existing output before the work, not after it.
    let folder = AtomicDir::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let (edited, motion) = (Arc::new(edited), Instant::now());
    let stages = Stages::new(console);
    let propagation = amg::propagate(source.scene.clone(), edited, &options, &|name, fraction| {
        stages.set(name, fraction);
    })
    .map_err(|error| Failure::bad_input(format!("{}: {}", args.edited.display(), chain(&error))))?;
    drop(stages);
    let seconds = motion.elapsed().as_secs_f64();
    messages::report(&propagation.report, args.motion, seconds, console);
    messages::warn_if_static(args, &propagation, console);
    let (source, options, propagation) = (&source, &options, &propagation);
    let finished =
        Finished { args, recorded, global, source, options, follow, propagation, seconds };
    finished.write(folder.path(), console)?;
    folder.commit().map_err(|error| output_failure(&error))?;
    console.detail(format!("run written {:.2} s after the start", start.elapsed().as_secs_f64()));
    Ok(())
}

/// Whether to follow splats or surfaces: as requested, else chosen by the lifetimes of the splats.
fn follow(args: &PropagateJob, source: &LoadedScene, console: &Console) -> Outcome<FollowArg> {
    if args.follow == Some(FollowArg::Surface) && args.baseline == Some(BaselineArg::Deformnet) {
        return Err(Failure::usage(
            "--follow surface does not apply to --baseline deformnet, which evaluates the network at the edited splats",
        )
        .next("Omit one of them."));
    }
    let lifetimes = Lifetimes::of(&*source.scene, args.time)?.filter(Lifetimes::is_partial);
    // Published methods follow splats.
    let usual = args.preset == PresetArg::Default
        && args.baseline.is_none()
        && args.motion == MotionArg::Edited;
    let follow = match (args.follow, &lifetimes) {
        (Some(requested), _) => requested,
        (None, Some(_)) if usual => FollowArg::Surface,
        (None, _) => FollowArg::Splats,
    };
    if let Some(lifetimes) = lifetimes {
        let becomes = match follow {
            FollowArg::Splats => {
                "the edit applies to these only and disappears where other splats replace them (--follow splats)"
            }
            FollowArg::Surface => "splats that replace them inherit the edit (--follow surface)",
        };
        console.note(format!("{}: {becomes}", lifetimes.describe()));
    }
    Ok(follow)
}

fn options(args: &PropagateJob, source: &LoadedScene) -> Outcome<MotionOptions> {
    let mut options = match (args.baseline, args.preset) {
        (Some(BaselineArg::Knn), _) => MotionOptions::preset(MotionPreset::Knn),
        (Some(BaselineArg::Deformnet), _) => {
            let network = source.network.clone().ok_or_else(|| {
                Failure::usage(format!(
                    "--baseline deformnet: {} ({}) has no deformation network",
                    source.path.display(),
                    source.kind
                ))
                .next("This baseline needs a 4DGS or Swift4D model; --baseline knn works on every scene.")
            })?;
            MotionOptions::field(Arc::new(NetworkField(network)))
        }
        (None, PresetArg::Paper) => MotionOptions::preset(MotionPreset::Paper),
        (None, PresetArg::Default) => MotionOptions::preset(MotionPreset::Regions),
    };
    options.edit_time = Some(args.time);
    if let MotionGuide::Paper(params) = &mut options.guide {
        params.anchors.seed = args.seed;
    }
    options.identity.enabled = args.motion == MotionArg::Edited;
    args.settings.apply(&mut options)?;
    Ok(options)
}

/// Settings of the refinement of this run.
fn refinement(args: &PropagateJob) -> Outcome<(PresetArg, RefineSettings)> {
    let settings = args.settings.refine();
    Ok((settings.preset()?.unwrap_or(args.preset), settings))
}

/// Refuses an edit that does not fit into memory.
fn require_memory(sources: usize, edited: usize, follow: FollowArg) -> Outcome {
    let splats = (sources + edited) as u64;
    let lifetimes =
        if follow == FollowArg::Surface { sources as u64 * BYTES_PER_LIFETIME } else { 0 };
    memory::require(
        &format!("propagating {splats} splats"),
        splats * BYTES_PER_SPLAT + lifetimes,
        "Close other programs, use a machine with more memory, or edit a scene with fewer splats.",
    )
}
