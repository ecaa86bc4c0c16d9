//! Opening SCENE: a model folder of 4DGS or Swift4D, a sequence of frames, a `.splatv` or
//! `.splat4d` clip, or a run of ours.

use super::repaired::say_repair;
use super::{Opened, Run, UP_CAPTURED, bad_input, trained};
use crate::args::Global;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::field::Network;
use crate::model_flags::{damage, overrides, sequence_axes};
use crate::passes::Mask;
use crate::ply_comments::{fps_of, up_of};
use crate::run_folder::{CONFIG, RefineConfig, RunFiles, SCENE, fingerprint};
use crate::suggestion::{self, Needed};
use amg::RowKind;
use gs_core::DynamicScene;
use gs_io::checkpoint4dgs;
use gs_io::model_folder::{ModelReport, ModelScene};
use gs_io::ply_sequence::{PlySequence, SequenceOptions};
use gs_io::{IoError, SceneKind, swift4d};
use std::path::Path;
use std::path::PathBuf;
use std::sync::Arc;

/// What a scene may be.
const SCENES: &str = "SCENE is a trained scene (model folder, checkpoint or PLY of 4DGaussians, Swift4D, Deformable-3D-Gaussians, SC-GS, Grid4D, DASH, E-D3DGS, native 4D Gaussians, FreeTimeGS, Spacetime Gaussians or Dynamic 3D Gaussians), numbered frames in a folder or zip archive, a .splatv, .splat4d or .4dgs clip, or a run folder.";
/// Share of the distance between unrelated rows above which the rows of a sequence do not persist.
const MAX_DRIFT: f32 = 0.3;
/// D-NeRF scenes: z points up.
const UP_SYNTHETIC: [f64; 3] = [0.0, 0.0, 1.0];
/// Channels of the planes of the published D-NeRF configurations, and of no other.
const DNERF_CHANNELS: usize = 32;
/// Splats of a `.splatv` that fade more slowly than this (the clip lasts 1) are there all the time.
const ALWAYS_THERE: f32 = 10.0;
/// Opens a scene and reports what was found odd about it.
pub(crate) fn open(path: &Path, global: &Global, console: &Console) -> Outcome<Opened> {
    if global.iteration.is_some() || !global.set.is_empty() {
        refuse_model_flags(path, global.iteration)?;
    }
    open_within(path, &[], global, console)
}

/// Flags that only model folders have, given for something else: whoever gives them expects that
/// they do something.
pub(crate) fn refuse_model_flags(path: &Path, iteration: Option<u64>) -> Outcome {
    match gs_io::detect(path) {
        Ok(SceneKind::PlySequence) if iteration.is_none() => Ok(()),
        Ok(kind)
            if !matches!(kind, SceneKind::Model4dgs | SceneKind::Swift4d) && !kind.is_source() =>
        {
            Err(Failure::usage(format!(
                "--iteration and --set apply to model folders (a sequence takes --set axes=…); {} is not one ({kind})",
                path.display()
            ))
            .next("Leave them out. A run records those of its source."))
        }
        _ => Ok(()),
    }
}

/// As [`open`], for the source of runs: `runs` are the run folders on the way, outermost first.
fn open_within(
    path: &Path,
    runs: &[PathBuf],
    global: &Global,
    console: &Console,
) -> Outcome<Opened> {
    if !path.exists() {
        return Err(Failure::bad_input(format!("{} does not exist", path.display())).next(SCENES));
    }
    match gs_io::detect(path).map_err(|error| bad_input(&error))? {
        kind @ (SceneKind::Model4dgs | SceneKind::Swift4d) => {
            open_model(path, kind, global, console)
        }
        kind if kind.is_source() => trained::open(path, kind, global, console),
        SceneKind::PlySequence => open_sequence(path, global, console),
        SceneKind::Splatv => open_splatv(path, global, console),
        SceneKind::Splat4d => open_splat4d(path, global, console),
        SceneKind::RunFolder => open_edited(path, runs, global, console),
        kind @ SceneKind::Model3dgs => Err(Failure::bad_input(format!(
            "{} is a {kind}: no save of it has a deformation",
            path.display()
        ))
        .next(format!(
            "If it is a 4DGaussians model, copy deformation.pth beside its point_cloud.ply; of Deformable-3D-Gaussians and methods like it, copy the folder deform beside point_cloud. As an edited frame: c4d propagate SCENE --edited {}. {SCENES}",
            path.display()
        ))),
        kind if kind.is_frame() => Err(Failure::bad_input(format!(
            "{} is a single frame ({kind}): it does not move",
            path.display()
        ))
        .next(format!(
            "Give the dynamic scene here; c4d propagate SCENE --edited takes the frame, c4d render shows it. {SCENES}"
        ))),
        SceneKind::Cameras(format) => Err(Failure::bad_input(format!(
            "{} holds cameras ({format}) and no splats",
            path.display()
        ))
        .next("Give the model trained on it as SCENE, and this path with --cameras.")),
        kind => {
            let next = match (suggestion::for_path(path, Needed::Scene), &kind) {
                (Some(next), _) => next,
                (None, SceneKind::Unsupported(format)) => format.next.to_owned(),
                (None, _) => SCENES.to_owned(),
            };
            let what = format!("{} is not a scene ({kind})", path.display());
            Err(Failure::bad_input(what).next(next))
        }
    }
}

fn open_model(path: &Path, kind: SceneKind, global: &Global, console: &Console) -> Outcome<Opened> {
    let overrides = overrides(global, &kind)?;
    let swift4d = kind == SceneKind::Swift4d;
    let read = if swift4d { swift4d::open } else { checkpoint4dgs::open };
    let model = read(path, &overrides).map_err(|error| match &error {
        // The file is there, so flags decide.
        IoError::Content { path, .. } if path.is_file() => bad_input(&error)
            .next("Give flags as --set FLAG=VALUE, repeated for several; c4d --help lists them."),
        _ => bad_input(&error),
    })?;
    let report = &model.report;
    for warning in &report.warnings {
        console.warn(format!("{}: {warning}", path.display()));
    }
    for note in &report.notes {
        console.note(format!("{}: {note}", path.display()));
    }
    for hint in &report.untrained_heads {
        console.detail(format!("hint: {hint}"));
    }
    let synthetic = !swift4d && report.channels == DNERF_CHANNELS;
    let background = match report.white_background {
        Some(true) => [1.0; 3],
        // Every published Swift4D model was trained on white.
        None if swift4d => [1.0; 3],
        _ => [0.0; 3],
    };
    let folder = report.ply.parent().unwrap_or(path);
    let field = folder.join(if swift4d { "FDHash.pth" } else { "deformation.pth" });
    let files = [report.ply.clone(), field, path.join("cfg_args")]
        .into_iter()
        .filter(|file| file.is_file())
        .collect();
    let facts = model_facts(report);
    let (scene, network): (Arc<dyn DynamicScene>, _) = match model.scene {
        ModelScene::Deformed(scene) => {
            let scene = Arc::from(scene);
            (Arc::clone(&scene) as _, Some(Network::HexPlane(scene)))
        }
        ModelScene::HashGrid(scene) => {
            let scene = Arc::from(scene);
            (Arc::clone(&scene) as _, Some(Network::HashGrid(scene)))
        }
        ModelScene::Static(scene) => (Arc::new(scene), None),
    };
    Ok(Opened {
        edit_time: scene.time_range().start,
        scene,
        network,
        kind,
        path: path.to_owned(),
        roots: vec![path.to_owned()],
        original: None,
        mask: Mask::default(),
        source_rows: None,
        up: if synthetic { UP_SYNTHETIC } else { UP_CAPTURED },
        fps: None,
        background,
        facts,
        files,
    })
}

fn model_facts(report: &ModelReport) -> Vec<(&'static str, String)> {
    // Of a save without a number, as `iteration_best`, the name.
    let folder = report.ply.parent().and_then(Path::file_name);
    let iteration = match folder.filter(|_| report.iteration == 0) {
        Some(name) => name.to_string_lossy().into_owned(),
        None => report.iteration.to_string(),
    };
    let mut facts = vec![
        ("iteration", iteration),
        ("stage", format!("{:?}", report.stage).to_lowercase()),
        ("heads", report.heads.join(", ")),
    ];
    if report.width > 0 {
        facts.push((
            "network",
            format!(
                "width {}, {} levels × {} channels",
                report.width, report.levels, report.channels
            ),
        ));
    }
    if let Some(split) = report.split {
        facts.push((
            "dynamic",
            format!(
                "{} of {} splats, {} of them in the field's box; the others never move",
                split.num_dynamic, report.num_splats, split.num_moving
            ),
        ));
    }
    for flag in &report.flags {
        facts.push(("flag", format!("{} = {} ({:?})", flag.name, flag.value, flag.origin)));
    }
    facts
}

fn open_sequence(path: &Path, global: &Global, console: &Console) -> Outcome<Opened> {
    let axes = sequence_axes(global)?;
    let options = SequenceOptions { damage: damage(global), axes, ..SequenceOptions::default() };
    let sequence = PlySequence::open(path, &options).map_err(|error| bad_input(&error))?;
    if !sequence.ignored().is_empty() {
        console.detail(format!("{}: ignored {}", path.display(), sequence.ignored().join(", ")));
    }
    let notes = sequence.notes().map_err(|error| bad_input(&error))?;
    for note in sequence.series().map(str::to_owned).into_iter().chain(notes) {
        console.note(format!("{}: {note}", path.display()));
    }
    say_repair(path, sequence.repair(), global, console);
    let drift = sequence.row_drift().map_err(|error| bad_input(&error))?;
    if drift > MAX_DRIFT {
        console.warn(format!(
            "{}: rows hardly persist from frame to frame (they move {:.0} % of the distance of unrelated rows): frames whose rows an editor or converter sorted again are not a scene",
            path.display(),
            100.0 * drift
        ));
    }
    let files = sequence.paths().to_vec();
    let up = files.first().and_then(|first| up_of(first)).unwrap_or(UP_CAPTURED);
    let mut facts = vec![("frames", sequence.num_frames().unwrap_or_default().to_string())];
    facts.extend(sequence.series().map(|series| ("series", series.to_owned())));
    let fps = files.first().and_then(|first| fps_of(first));
    Ok(Opened {
        edit_time: sequence.time_range().start,
        scene: Arc::new(sequence),
        network: None,
        kind: SceneKind::PlySequence,
        path: path.to_owned(),
        roots: vec![path.to_owned()],
        original: None,
        mask: Mask::default(),
        source_rows: None,
        up,
        fps,
        background: [0.0; 3],
        facts,
        files,
    })
}

fn open_splatv(path: &Path, global: &Global, console: &Console) -> Outcome<Opened> {
    let read = gs_io::splatv::open(path, damage(global)).map_err(|error| bad_input(&error))?;
    say_repair(path, read.repair, global, console);
    let always = read.scene.motions().iter().filter(|motion| motion.width > ALWAYS_THERE).count();
    let facts =
        vec![("motion", "one cubic a splat".to_owned()), ("always there", always.to_string())];
    Ok(Opened {
        edit_time: read.scene.time_range().start,
        scene: Arc::new(read.scene),
        network: None,
        kind: SceneKind::Splatv,
        path: path.to_owned(),
        roots: vec![path.to_owned()],
        original: None,
        mask: Mask::default(),
        source_rows: None,
        up: read.up.unwrap_or(UP_CAPTURED),
        fps: None,
        background: [0.0; 3],
        facts,
        files: vec![path.to_owned()],
    })
}

fn open_splat4d(path: &Path, global: &Global, console: &Console) -> Outcome<Opened> {
    let read = gs_io::splat4d::open(path, damage(global)).map_err(|error| bad_input(&error))?;
    say_repair(path, read.repair, global, console);
    let facts = vec![
        ("frames", read.scene.num_frames().unwrap_or_default().to_string()),
        ("fps", read.fps.to_string()),
    ];
    Ok(Opened {
        edit_time: read.scene.time_range().start,
        mask: Mask::default(),
        source_rows: None,
        scene: Arc::new(read.scene),
        network: None,
        kind: SceneKind::Splat4d,
        path: path.to_owned(),
        roots: vec![path.to_owned()],
        original: None,
        up: read.up.unwrap_or(UP_CAPTURED),
        fps: Some(read.fps),
        background: [0.0; 3],
        facts,
        files: vec![path.to_owned()],
    })
}

/// Reads a run and opens its source.
pub(crate) fn open_run(path: &Path, global: &Global, console: &Console) -> Outcome<Run> {
    open_run_within(path, &[], global, console)
}

fn open_run_within(
    path: &Path,
    runs: &[PathBuf],
    global: &Global,
    console: &Console,
) -> Outcome<Run> {
    let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    if runs.contains(&real) {
        return Err(Failure::bad_input(format!("the run {} is its own source", path.display()))
            .next(format!(
                "Correct `source` in {}, or run c4d propagate again.",
                path.join(CONFIG).display()
            )));
    }
    let mut runs = runs.to_vec();
    runs.push(real);
    let RunFiles { config, stored, source: source_path } = RunFiles::read(path)?;
    let source_global =
        Global { iteration: config.iteration, set: config.set.clone(), ..global.clone() };
    let source = open_within(&source_path, &runs, &source_global, console)?;
    if fingerprint(&source.files)? != config.source_sha256 {
        console.warn(format!(
            "{} has changed since {} was made: its motion may no longer fit the edit. Run c4d propagate again.",
            source_path.display(),
            path.display()
        ));
    }
    Ok(Run { config, stored, source })
}

/// Opens a run as a scene: its source, the edited frame, and the binding between them.
fn open_edited(
    path: &Path,
    runs: &[PathBuf],
    global: &Global,
    console: &Console,
) -> Outcome<Opened> {
    let run = open_run_within(path, runs, global, console)?;
    let scene = run.scene(path, true)?;
    let Run { config, stored, source } = run;
    let count = |kind| stored.binding.count(kind);
    let rows = format!(
        "{} unchanged, {} recoloured, {} moved, {} blended, {} static",
        count(RowKind::Unchanged),
        count(RowKind::Recoloured),
        count(RowKind::Moved),
        count(RowKind::Blended),
        count(RowKind::Static)
    );
    let refined = stored.refined.as_ref().map_or("no".to_owned(), |refined| {
        format!("{} splats have new colours", refined.changed(&stored.edited))
    });
    let facts = vec![
        ("source", source.path.display().to_string()),
        ("edited", config.edited.display().to_string()),
        ("edit time", config.edit_time.to_string()),
        (
            "method",
            format!("{}, baseline {}, motion {}", config.preset, config.baseline, config.motion),
        ),
        ("rows", rows),
        ("refined", refined),
    ];
    let mut files = vec![path.join(SCENE)];
    files.extend(source.files);
    let mut roots = vec![path.to_owned()];
    roots.extend(source.roots);
    Ok(Opened {
        roots,
        edit_time: config.edit_time,
        scene: Arc::new(scene),
        network: None,
        kind: SceneKind::RunFolder,
        path: path.to_owned(),
        original: Some(source.scene),
        up: source.up,
        fps: source.fps,
        background: source.background,
        source_rows: Some(stored.source_rows()),
        mask: config.refine.as_ref().map_or_else(Mask::default, RefineConfig::mask),
        facts,
        files,
    })
}
