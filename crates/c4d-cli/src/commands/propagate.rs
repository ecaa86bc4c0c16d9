//! `c4d propagate`: propagate an edited frame to all times.

use super::{dry_run, refine, source_match};
use crate::args::{BaselineArg, FollowArg, Global, MotionArg, PresetArg, PropagateArgs};
use crate::console::Console;
use crate::edited_axes;
use crate::failure::{Failure, Outcome, chain};
use crate::field::NetworkField;
use crate::lifetimes::Lifetimes;
use crate::model_flags::damage;
use crate::output::{existing, output_failure, refuse_overlap};
use crate::report::{RunReport, run_report};
use crate::run_folder::{self, CONFIG, Checkpoint, REPORT, REPORT_PAGE, RunConfig, SCENE, Stored};
use crate::scene::{self, Opened};
use crate::settings::{
    AnchorSettings, KnnSettings, PropagateJob, RefineSettings, Settings, TransportSettings,
};
use crate::suggestion::{self, Needed};
use crate::{frames, memory, placement};
use amg::{Follow, MotionGuide, MotionOptions, MotionReport, Preset, Propagation};
use clap::ValueEnum;
use gs_core::{Extent, Precision, Splats};
use gs_io::AtomicDir;
use gs_io::ply::comments;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Most memory that the motion stage takes per splat of the source and of the edit, bytes
/// (measured: 1.2 KiB, see the benchmarks).
const BYTES_PER_SPLAT: u64 = 1536;
/// Additional memory per splat of the source for `--follow surface`: 65 key times of 16 bytes,
/// and carriers.
const BYTES_PER_LIFE: u64 = 2048;

/// Paths to note in the run, where they differ from those read.
pub(crate) struct Recorded {
    pub(crate) scene: PathBuf,
    pub(crate) edited: PathBuf,
}

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
        let begun = Checkpoint::anew(preset, settings, &args.refine);
        refine::refine(&args.output, begun, global, console)?;
    }
    console.note(format!(
        "to view it: c4d render {0} --side-by-side -o clip.mp4; to export it: c4d export {0} --to ply-seq -o frames",
        args.output.display()
    ));
    console.result(args.output.display());
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
    let (edited, precision) = read_edited(args, &source_splats, global, console)?;
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
    let splats = (source_splats.len() + edited.len()) as u64;
    memory::require(
        &format!("carrying {splats} splats"),
        splats * BYTES_PER_SPLAT
            + if follow == FollowArg::Surface {
                source_splats.len() as u64 * BYTES_PER_LIFE
            } else {
                0
            },
        "Close other programs, use a machine with more memory, or edit a scene with fewer splats.",
    )?;
    // Refuse existing output before the work, not after it.
    let folder = AtomicDir::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let (edited, motion) = (Arc::new(edited), Instant::now());
    let propagation = {
        let stage = Mutex::new(None::<(&'static str, crate::progress::StageProgress)>);
        let progress = |name: &'static str, fraction: f32| {
            let Ok(mut current) = stage.lock() else { return };
            if current.as_ref().is_none_or(|(running, _)| *running != name)
                && let Some((_, finished)) = current.replace((name, console.percent(name)))
            {
                finished.finish();
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to 0..=100"
            )]
            if let Some((_, bar)) = current.as_mut() {
                bar.set((fraction.clamp(0.0, 1.0) * 100.0) as u64);
            }
        };
        amg::propagate(source.scene.clone(), edited, &options, &progress).map_err(|error| {
            Failure::bad_input(format!("{}: {}", args.edited.display(), chain(&error)))
        })?
    };
    let seconds = motion.elapsed().as_secs_f64();
    report(&propagation.report, args.motion, seconds, console);
    warn_if_still(args, &propagation, console);

    let absolute = |path: &Path| std::path::absolute(path).map_err(Failure::failed);
    let mut config = RunConfig {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        source: absolute(&recorded.scene)?,
        source_from_run: run_folder::relative(&absolute(&args.output)?, &absolute(&args.scene)?),
        source_sha256: run_folder::fingerprint(&source.files)?,
        edited: absolute(&recorded.edited)?,
        edited_sha256: run_folder::fingerprint(&[gs_io::frame::file_of(&args.edited)])?,
        edit_time: args.time,
        align: args.align,
        keep_rest: args.keep_rest,
        allow_far: args.allow_far,
        axes: args.axes.and_then(|axes| Some(axes.to_possible_value()?.get_name().to_owned())),
        preset: format!("{:?}", args.preset).to_lowercase(),
        baseline: args.baseline.map_or("none".to_owned(), |b| format!("{b:?}").to_lowercase()),
        motion: if args.motion == MotionArg::Amg { "amg" } else { "amg-all" }.to_owned(),
        follow: follow.name().to_owned(),
        seed: args.seed,
        iteration: global.iteration,
        set: global.set.clone(),
        position: String::new(),
        rotation: String::new(),
        scale: String::new(),
        appearance: false,
        rotation_prior: 0.0,
        fading: false,
        anchors: None,
        transport: None,
        knn: None,
        regions: None,
        refine: None,
    };
    match &options.guide {
        MotionGuide::Paper(params) => {
            config.anchors = Some(AnchorSettings::of(params));
            config.transport = Some(TransportSettings::of(params));
        }
        MotionGuide::Knn(params) => config.knn = Some(KnnSettings::of(*params)),
        MotionGuide::Regions(params) => config.regions = Some(params.clone()),
        MotionGuide::Field(_) => {}
    }
    config.set_aggregation(*propagation.scene.aggregation());
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).map_err(|error| Failure::write(&path, &error))
    };
    let binding = propagation.scene.binding().as_ref().clone();
    // Values that only the file format changed are restored.
    let edited = propagation.scene.edited().as_ref().clone();
    let stored = Stored { edited, binding, refined: None };
    write(SCENE, &stored.serialize()?)?;
    write(CONFIG, toml::to_string(&config).map_err(Failure::failed)?.as_bytes())?;
    let json = report_json(&propagation.report, seconds);
    write(REPORT, serde_json::to_string_pretty(&json).map_err(Failure::failed)?.as_bytes())?;
    let begun = Instant::now();
    let page = RunReport {
        name: args
            .output
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
        scene: &propagation.scene,
        source: source.scene.as_ref(),
        up: source.up,
        background: source.background,
        facts: facts(&config, &propagation.report, seconds),
        warnings: propagation.report.warnings.clone(),
    };
    match run_report(&page) {
        Ok(html) => write(REPORT_PAGE, html.as_bytes())?,
        Err(failure) => console.warn(format!("{REPORT_PAGE} is not written: {}", failure.what)),
    }
    console.detail(format!("  {REPORT_PAGE}: {:.3} s", begun.elapsed().as_secs_f64()));
    folder.commit().map_err(|error| output_failure(&error))?;
    console.detail(format!("run written {:.2} s after the start", start.elapsed().as_secs_f64()));
    Ok(())
}

/// Whether to follow splats or surfaces: as requested, else by the lifetimes of the scene's splats.
fn follow(args: &PropagateJob, source: &Opened, console: &Console) -> Outcome<FollowArg> {
    if args.follow == Some(FollowArg::Surface) && args.baseline == Some(BaselineArg::Deformnet) {
        return Err(Failure::usage(
            "--follow surface does not apply to --baseline deformnet, which evaluates the network at the edited splats",
        )
        .next("Leave one of them out."));
    }
    let lifetimes = Lifetimes::of(&*source.scene, args.time)?.filter(Lifetimes::is_partial);
    // Published methods follow splats.
    let usual =
        args.preset == PresetArg::Best && args.baseline.is_none() && args.motion == MotionArg::Amg;
    let follow = match (args.follow, &lifetimes) {
        (Some(asked), _) => asked,
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

fn options(args: &PropagateJob, source: &Opened) -> Outcome<MotionOptions> {
    let mut options = match (args.baseline, args.preset) {
        (Some(BaselineArg::Knn), _) => MotionOptions::preset(Preset::Knn),
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
        (None, PresetArg::Paper) => MotionOptions::preset(Preset::Paper),
        (None, PresetArg::Best) => MotionOptions::preset(Preset::Regions),
    };
    options.edit_time = Some(args.time);
    if let MotionGuide::Paper(params) = &mut options.guide {
        params.anchors.seed = args.seed;
    }
    options.identity.enabled = args.motion == MotionArg::Amg;
    args.settings.apply(&mut options)?;
    Ok(options)
}

/// Settings of the refinement of this run.
fn refinement(args: &PropagateJob) -> Outcome<(PresetArg, RefineSettings)> {
    let settings = args.settings.refine();
    Ok((settings.preset()?.unwrap_or(args.preset), settings))
}

/// Reads the edited frame, repairs it if possible, and converts it to the scene's SH degree; also
/// returns the precision of its format.
fn read_edited(
    args: &PropagateJob,
    source: &Splats,
    global: &Global,
    console: &Console,
) -> Outcome<(Splats, Option<Arc<Precision>>)> {
    let (path, time, sh_degree) = (args.edited.as_path(), args.time, source.sh_degree);
    let frame = gs_io::frame::read_file(path).map_err(|error| {
        let failure = scene::bad_input(&error);
        match suggestion::for_path(path, Needed::Frame).filter(|_| path.is_dir()) {
            Some(next) => failure.next(next),
            None => failure,
        }
    })?;
    let file = gs_io::frame::file_of(path);
    if file != path {
        console.note(format!("{}: the frame is {}", path.display(), file.display()));
    }
    let noted = frame
        .comments
        .iter()
        .find_map(|comment| comment.strip_prefix(comments::TIME)?.trim().parse::<f32>().ok());
    if let Some(noted) = noted
        && (noted - time).abs() > 1e-6
    {
        return Err(Failure::usage(format!(
            "{} was frozen at time {noted}, not at --time {time}",
            path.display()
        ))
        .next(format!("Run again with --time {noted}.")));
    }
    for note in &frame.notes {
        console.note(format!("{}: {note}", path.display()));
    }
    if frame.precision.is_some() {
        console.note(format!(
            "{} ({}) rounds its values: splats that agree with the scene within that get the scene's own values back",
            path.display(),
            frame.format
        ));
    }
    let frame = edited_axes::resolve(frame, path, source, args.axes, console)?;
    let rows = frame.splats.len();
    let (frame, damaged) = frame.sanitize(damage(global)).map_err(|error| {
        Failure::bad_input(format!("{}: {}", path.display(), chain(&error))).next(
            if global.strict {
                "Without --strict such rows are dropped and counted."
            } else {
                "Export the edited frame again; c4d info FILE says what is in it."
            },
        )
    })?;
    if let Some(note) = damaged.infinities.note() {
        console.note(format!("{}: {note}", path.display()));
    }
    if frame.splats.len() < rows {
        console.warn(format!(
            "{}: dropped {} of {} rows ({} not finite, {} with a zero quaternion)",
            path.display(),
            damaged.not_finite + damaged.zero_quaternion,
            damaged.rows,
            damaged.not_finite,
            damaged.zero_quaternion
        ));
    }
    let (splats, precision) = (frame.splats, frame.precision);
    if splats.is_empty() {
        return Err(Failure::bad_input(format!("{}: no usable splats", path.display()))
            .next("Export the edited frame again; c4d info FILE says what is in it."));
    }
    if splats.sh_degree == sh_degree {
        return Ok((splats, precision));
    }
    let verb = if splats.sh_degree < sh_degree { "padded with zeros" } else { "cut" };
    console.warn(format!(
        "{}: SH degree {} {verb} to the scene's {sh_degree}{}",
        path.display(),
        splats.sh_degree,
        if precision.is_some() { "; unchanged splats keep theirs" } else { "" }
    ));
    Ok((splats.with_sh_degree(sh_degree), precision))
}

/// Warns if an edit cannot move, or does not match the frame that it should be an edit of.
fn warn_if_still(args: &PropagateJob, propagation: &Propagation, console: &Console) {
    let report = &propagation.report;
    let estimated = report.blended + report.field_rows;
    let moves = |source: u32| propagation.split.dynamic[source as usize];
    let exact = propagation.identity.rows.iter().any(|row| row.source().is_some_and(moves));
    if report.num_dynamic > 0 && estimated == 0 && !exact {
        console.warn(format!(
            "{}: no splat matches a moving splat of the scene, so the result will not move",
            args.edited.display()
        ));
    }
    let kept = propagation.identity.matched();
    if args.motion == MotionArg::Amg && kept * 100 < report.num_edited_splats {
        console.warn(format!(
            "{}: {kept} of {} splats are splats of the scene at time {}. Unless everything was restyled, it may be of another time (--time) or another scene",
            args.edited.display(),
            report.num_edited_splats,
            args.time
        ));
    }
}

fn report(report: &MotionReport, motion: MotionArg, seconds: f64, console: &Console) {
    for warning in &report.warnings {
        console.warn(warning);
    }
    if motion == MotionArg::AmgAll {
        // Nothing was compared, so the counts of kept splats have no meaning.
        console.note("the motion of every edited splat is estimated anew (--motion amg-all)");
    } else {
        console.note(format!(
            "{} unchanged (exact), {} recoloured (exact motion), {} edited or new; {} source splats removed",
            report.unchanged, report.recoloured, report.edited, report.vanished
        ));
    }
    for (count, what) in &report.moved_groups {
        console.note(format!("{count} splats moved as one: {what}; they keep their own motion"));
    }
    if report.beside_copies > 0 {
        console.note(format!("{} edited splats beside a copy follow it", report.beside_copies));
    }
    console.note(format!(
        "motion of {} edited splats from {} moving source splats in {seconds:.2} s; {} stay put",
        report.blended + report.field_rows,
        report.num_dynamic,
        report.static_rows
    ));
    if let Some(descent) = &report.descent {
        console.note(format!(
            "the edit frame shows {} of {} splats that are ever visible; {} of the others are matched to these",
            descent.shown, descent.visible, descent.descended
        ));
        console.note(format!(
            "inherited: {} recoloured, {} removed, {} moved; confidence {:.2}, {} below 0.5",
            descent.recoloured, descent.removed, descent.moved, descent.confidence, descent.unsure
        ));
    }
    for (stage, secs) in &report.timings {
        console.detail(format!("  {stage}: {secs:.3} s"));
    }
}

/// The text about the propagation in the run's page.
fn facts(config: &RunConfig, report: &MotionReport, seconds: f64) -> Vec<(String, String)> {
    let method = match config.baseline.as_str() {
        "none" => format!("preset {}, motion {}", config.preset, config.motion),
        baseline => format!("baseline {baseline}, motion {}", config.motion),
    };
    [
        ("source", config.source.display().to_string()),
        ("edited", config.edited.display().to_string()),
        ("time of the edit", config.edit_time.to_string()),
        ("method", method),
        ("splats of the source", format!("{}, {} move", report.num_sources, report.num_dynamic)),
        (
            "splats of the edit",
            format!(
                "{}: {} unchanged, {} recoloured, {} moved as groups, {} edited or new",
                report.num_edited_splats,
                report.unchanged,
                report.recoloured,
                report.moved,
                report.edited
            ),
        ),
        ("removed", report.vanished.to_string()),
        ("motion", format!("{seconds:.2} s")),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

fn report_json(report: &MotionReport, seconds: f64) -> Value {
    let timings: serde_json::Map<String, Value> =
        report.timings.iter().map(|(stage, secs)| ((*stage).to_owned(), json!(secs))).collect();
    json!({
        "schema": 1,
        "motion_seconds": seconds,
        "timings": timings,
        "source": {
            "splats": report.num_sources,
            "moving": report.num_dynamic,
            "floaters": report.num_floaters,
            "broken": report.num_broken_sources,
            "dynamic_threshold": report.dynamic_threshold,
            "figure_size": report.figure_size,
            "parts": report.num_parts,
        },
        "edited": {
            "splats": report.num_edited_splats,
            "unchanged": report.unchanged,
            "recoloured": report.recoloured,
            "moved": report.moved,
            "moved_groups": report.moved_groups.iter().map(|(splats, what)| json!({
                "splats": splats,
                "what": what,
            })).collect::<Vec<_>>(),
            "edited": report.edited,
            "removed": report.vanished,
            "blended": report.blended,
            "static": report.static_rows,
            "beside_copies": report.beside_copies,
            "field": report.field_rows,
            "out_of_reach": report.out_of_reach,
            "broken": report.broken_rows,
        },
        "descent": report.descent.as_ref().map(|descent| json!({
            "visible": descent.visible,
            "shown": descent.shown,
            "descended": descent.descended,
            "recoloured": descent.recoloured,
            "removed": descent.removed,
            "moved": descent.moved,
            "confidence": descent.confidence,
            "unsure": descent.unsure,
            "lasting": descent.lasting,
        })),
        "anchors": { "source": report.anchors[0], "edited": report.anchors[1], "unmatched": report.unmatched_anchors },
        "transport": report.transport.as_ref().map(|transport| json!({
            "converged": transport.converged,
            "sweeps": transport.sweeps,
            "residual": transport.residual,
            "median_distance": transport.d_med,
            "beta": transport.beta,
            "total_mass": transport.total_mass,
        })),
        "warnings": report.warnings,
    })
}
