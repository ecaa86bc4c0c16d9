//! Opening SCENE: a model folder of 4DGS or Swift4D, a sequence of frames, a `.splatv` or `.splat4d` clip, or a run of ours.

use crate::args::Global;
use crate::console::Console;
use crate::failure::{Failure, Outcome, chain};
use crate::field::Network;
use crate::instead::{self, Needed};
use crate::model_flags::overrides;
use crate::passes::Mask;
use crate::run_folder;
use gs_core::DynamicScene;
use gs_io::cameras::CamerasError;
use gs_io::checkpoint4dgs;
use gs_io::frame::FrameError;
use gs_io::model_folder::{ModelReport, ModelScene};
use gs_io::ply_sequence::{PlySequence, SequenceOptions};
use gs_io::repair::{Damage, RepairReport};
use gs_io::{IoError, SceneKind, swift4d};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A scene ready to be asked for any time.
#[derive(Debug)]
pub(crate) struct Opened {
    /// The scene itself.
    pub(crate) scene: Arc<dyn DynamicScene>,
    /// The scene's own deformation network with its canonical splats, where it has one.
    pub(crate) network: Option<Network>,
    /// What the path is.
    pub(crate) kind: SceneKind,
    /// As given.
    pub(crate) path: PathBuf,
    /// The scene before the edit, for runs.
    pub(crate) original: Option<Arc<dyn DynamicScene>>,
    /// Time of the edited frame: a run's, else the start.
    pub(crate) edit_time: f32,
    /// The world's upward direction, as far as the files tell.
    pub(crate) up: [f64; 3],
    /// Frames per second of the clip, where its files note them.
    pub(crate) fps: Option<f64>,
    /// Background the model was trained with, else black.
    pub(crate) background: [f32; 3],
    /// Which pixels are artifacts: as a run was refined, else as usual.
    pub(crate) mask: Mask,
    /// Facts to show, name and value.
    pub(crate) facts: Vec<(&'static str, String)>,
    /// Folders the scene is read from, sources of runs included.
    pub(crate) roots: Vec<PathBuf>,
    /// Files whose content decides what the scene is, for fingerprints.
    pub(crate) files: Vec<PathBuf>,
}

/// What a scene may be.
const SCENES: &str = "SCENE is a 4DGS or Swift4D model folder, numbered frames in a folder or zip archive, a .splatv or .splat4d clip, or a run folder.";
/// What an edited frame may be.
const FRAMES: &str = "c4d goes by a file's content, not by the end of its name: export the splats as 3DGS PLY, compressed PLY, .splat, .spz, .sog or .glb.";
/// Share of the distance between unrelated rows above which the rows of a sequence do not persist.
const MAX_DRIFT: f32 = 0.3;
/// Captured scenes: y points down.
pub(crate) const UP_CAPTURED: [f64; 3] = [0.0, -1.0, 0.0];
/// D-NeRF scenes: z points up.
const UP_SYNTHETIC: [f64; 3] = [0.0, 0.0, 1.0];
/// Channels of the planes of the published D-NeRF configurations, and of no other.
const DNERF_CHANNELS: usize = 32;
/// Splats of a `.splatv` that fade more slowly than this (the clip lasts 1) are there all the time.
const ALWAYS_THERE: f32 = 10.0;
/// PLY comment in which our own sequences note the upward axis.
pub(crate) const UP_COMMENT: &str = "c4d_up ";
/// PLY comment in which our own sequences note their frame rate.
pub(crate) const FPS_COMMENT: &str = "c4d_fps ";

/// Converts a reader's error; its message names the file and what was found.
pub(crate) fn bad_input(error: &IoError) -> Failure {
    let failure = Failure::bad_input(chain(error));
    match error {
        IoError::Read { .. } => {
            failure.next("Check the name, and that it is a file that can be read.")
        }
        IoError::Damaged { .. } => {
            failure.next("Without --strict such rows are dropped and counted.")
        }
        IoError::StandIn { found, .. } => failure.next(found.next),
        IoError::Frame { path, source: FrameError::Unknown { .. } } => {
            match gs_io::detect(path) {
                Ok(SceneKind::Unsupported(format)) => failure.next(format.next),
                _ => failure.next(FRAMES),
            }
        }
        IoError::Frame { source: FrameError::Version { .. }, .. } => failure.next(
            "Convert it as above, or export the splats as a 3DGS PLY from the program that made it.",
        ),
        IoError::Cameras { source: CamerasError::Lens { .. }, .. } => failure.next(
            "Undistort the images, and give the folder that this writes; or give other cameras.",
        ),
        IoError::Ply { .. } | IoError::Frame { .. } => {
            failure.next("Copy the file again, or export the splats again as a 3DGS PLY.")
        }
        IoError::Splatv { .. } | IoError::Splat4d { .. } => {
            failure.next("Copy or export the clip again, or give the scene it was made from.")
        }
        IoError::Cameras { .. } => failure.next(
            "Write the file anew, or give other cameras: c4d info PATH says what a file or folder has.",
        ),
        _ => failure,
    }
}

/// What damaged rows do.
pub(crate) fn damage(global: &Global) -> Damage {
    if global.strict { Damage::Fail } else { Damage::Drop }
}

/// Refuses an output that is, holds, or lies in one of the inputs: writing it would destroy them.
pub(crate) fn refuse_overlap(output: &Path, inputs: &[PathBuf]) -> Outcome {
    let Some(output_real) = real(output) else { return Ok(()) };
    for input in inputs {
        let Some(input_real) = real(input) else { continue };
        if output_real.starts_with(&input_real) || input_real.starts_with(&output_real) {
            return Err(Failure::usage(format!(
                "the output {} and the input {} overlap",
                output.display(),
                input.display()
            ))
            .next("Choose another place for the output: inputs are never written to."));
        }
    }
    Ok(())
}

/// The path with links resolved; of a path that does not exist yet, its nearest existing folder resolved.
fn real(path: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(path).ok()?;
    absolute.ancestors().find_map(|ancestor| {
        let rest = absolute.strip_prefix(ancestor).ok()?;
        Some(ancestor.canonicalize().ok()?.join(rest))
    })
}

/// Opens a scene and reports what was found odd about it.
pub(crate) fn open(path: &Path, global: &Global, console: &Console) -> Outcome<Opened> {
    if global.iteration.is_some() || !global.set.is_empty() {
        refuse_model_flags(path)?;
    }
    open_within(path, &[], global, console)
}

/// Flags that only model folders have, given for something else: whoever gives them expects that they do something.
pub(crate) fn refuse_model_flags(path: &Path) -> Outcome {
    match gs_io::detect(path) {
        Ok(kind) if !matches!(kind, SceneKind::Model4dgs | SceneKind::Swift4d) => {
            Err(Failure::usage(format!(
                "--iteration and --set are for model folders; {} is none ({kind})",
                path.display()
            ))
            .next("Leave them out. A run notes those of its source."))
        }
        _ => Ok(()),
    }
}

/// As [`open`], for the source of runs: `runs` are the run folders on the way, outermost first.
pub(crate) fn open_within(
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
        SceneKind::PlySequence => open_sequence(path, global, console),
        SceneKind::Splatv => open_splatv(path, global, console),
        SceneKind::Splat4d => open_splat4d(path, global, console),
        SceneKind::RunFolder => run_folder::open(path, runs, global, console),
        kind @ SceneKind::Model3dgs => Err(Failure::bad_input(format!(
            "{} is a {kind}: no save of it has a deformation.pth",
            path.display()
        ))
        .next(format!(
            "If it is a 4DGaussians model, copy deformation.pth beside its point_cloud.ply. As an edited frame: c4d propagate SCENE --edited {}. {SCENES}",
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
        .next("Give the model that was trained on it as SCENE, and this with --cameras.")),
        kind => {
            let next = match (instead::of(path, Needed::Scene), &kind) {
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
        IoError::Content { path, .. } if path.is_file() => bad_input(&error).next(
            "Flags are given as --set FLAG=VALUE, several by repeating it; c4d --help lists them.",
        ),
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
    let options = SequenceOptions { damage: damage(global), ..SequenceOptions::default() };
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
            "{}: rows hardly persist from frame to frame (they move {:.0} % of the distance of unrelated rows): frames that an editor or converter sorted anew make no scene",
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
        up,
        fps,
        background: [0.0; 3],
        facts,
        files,
    })
}

/// Says what was done with damaged rows and with infinities that have a meaning.
pub(crate) fn say_repair(path: &Path, report: RepairReport, global: &Global, console: &Console) {
    if let Some(warning) = report.warning(damage(global) == Damage::Drop) {
        console.warn(format!("{}: {warning}", path.display()));
    }
    if let Some(note) = report.infinities.note() {
        console.note(format!("{}: {note}", path.display()));
    }
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

/// The upward axis that our own writer notes in a comment.
fn up_of(ply: &Path) -> Option<[f64; 3]> {
    up_axis(&noted(ply, UP_COMMENT)?)
}

/// The direction of an axis by name: `y`, `-z`.
pub(crate) fn up_axis(name: &str) -> Option<[f64; 3]> {
    let axis: crate::args::Up = clap::ValueEnum::from_str(name.trim(), true).ok()?;
    Some(axis.vector())
}

/// The frame rate that our own writer notes in a comment.
fn fps_of(ply: &Path) -> Option<f64> {
    noted(ply, FPS_COMMENT)?.parse().ok().filter(|&fps: &f64| fps > 0.0 && fps.is_finite())
}

/// What follows `name` in a comment of a PLY, or of the first one of an archive that does not compress.
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

/// Comments for a sequence whose world's up is `up`, when it is an axis: ours, and the one that Brush reads where it has a word for it
/// (there `y` means that −y is up).
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
    use crate::args::Up;
    [(Up::X, "x"), (Up::Y, "y"), (Up::Z, "z"), (Up::NegX, "-x"), (Up::NegY, "-y"), (Up::NegZ, "-z")]
        .into_iter()
        .find(|(axis, _)| axis.vector() == up)
        .map(|(_, name)| format!("{UP_COMMENT}{name}"))
}
