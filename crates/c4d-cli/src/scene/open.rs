//! Opening SCENE: a dynamic scene of any kind, or a run.

use super::{LoadedScene, Run, UP_CAPTURED, bad_input};
use crate::args::Global;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::model_flags::open_options;
use crate::passes::Mask;
use crate::run_folder::{CONFIG, RefineConfig, RunFiles, SCENE, fingerprint};
use crate::suggestion::{self, Needed};
use amg::RowKind;
use gs_deform::FieldError;
use gs_io::checkpoint4dgs::Checkpoint4dgsError;
use gs_io::swift4d::Swift4dError;
use gs_io::{IoError, OpenOptions, SceneKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Supported scenes.
const SCENES: &str = "SCENE is a trained scene (model folder, checkpoint or PLY of 4DGaussians, Swift4D, Deformable-3D-Gaussians, SC-GS, Grid4D, DASH, E-D3DGS, native 4D Gaussians, FreeTimeGS, Spacetime Gaussians or Dynamic 3D Gaussians), numbered frames in a folder or zip archive, a .splatv, .splat4d, .4dgs or .tsog clip, or a run folder.";

/// Opens a scene and reports warnings about it.
pub(crate) fn open(path: &Path, global: &Global, console: &Console) -> Outcome<LoadedScene> {
    if global.iteration.is_some() || !global.set.is_empty() {
        refuse_model_flags(path, global.iteration)?;
    }
    open_within(path, &[], global, console)
}

/// Refuses flags of model folders for other inputs, where they would have no effect. Unknown kinds
/// are accepted, because they include model folders whose main file is missing or empty; opening
/// reports that.
pub(crate) fn refuse_model_flags(path: &Path, iteration: Option<u64>) -> Outcome {
    match gs_io::detect(path) {
        Ok(SceneKind::PlySequence) if iteration.is_none() => Ok(()),
        Ok(SceneKind::Unknown { .. }) => Ok(()),
        Ok(kind) if !kind.is_trained() => Err(Failure::usage(format!(
            "--iteration and --set apply to model folders (a sequence takes --set axes=…); {} is not one ({kind})",
            path.display()
        ))
        .next("Omit them. A run records those of its source.")),
        _ => Ok(()),
    }
}

/// As [`open`], for the source of runs: `runs` are the enclosing run folders, outermost first.
fn open_within(
    path: &Path,
    runs: &[PathBuf],
    global: &Global,
    console: &Console,
) -> Outcome<LoadedScene> {
    if !path.exists() {
        return Err(Failure::bad_input(format!("{} does not exist", path.display())).next(SCENES));
    }
    match gs_io::detect(path).map_err(|error| bad_input(&error))? {
        kind if kind.is_dynamic() => {
            open_with(path, &kind, &open_options(global, &kind)?, console)
        }
        SceneKind::RunFolder => open_edited(path, runs, global, console),
        kind @ SceneKind::Model3dgs => {
            // A damaged file does not show which method wrote it.
            gs_io::ply::read_file(&gs_io::frame::file_of(path))
                .map_err(|error| bad_input(&error))?;
            Err(Failure::bad_input(format!(
                "{} is a {kind}: none of its iterations has a deformation",
                path.display()
            ))
            .next(format!(
                "If it is a 4DGaussians model, put deformation.pth next to its point_cloud.ply; of Deformable-3D-Gaussians and methods like it, put the folder deform next to point_cloud. As an edited frame: c4d propagate SCENE --edited {}. {SCENES}",
                path.display()
            )))
        }
        kind if kind.is_frame() => Err(Failure::bad_input(format!(
            "{} is a single frame ({kind}), expected a dynamic scene",
            path.display()
        ))
        .next(format!(
            "Use the dynamic scene here; c4d propagate SCENE --edited takes the frame, c4d render shows it. {SCENES}"
        ))),
        SceneKind::Cameras(format) => Err(Failure::bad_input(format!(
            "{} contains cameras ({format}) but no splats",
            path.display()
        ))
        .next("Pass the model trained on it as SCENE, and this path with --cameras.")),
        kind => {
            let next = match (suggestion::for_path(path, Needed::Scene), &kind) {
                (Some(next), _) => next,
                (None, SceneKind::Unsupported(format)) => format.next.to_owned(),
                (None, _) => SCENES.to_owned(),
            };
            let what = format!("{} is not a scene: found {}", path.display(), found(&kind));
            Err(Failure::bad_input(what).next(next))
        }
    }
}

/// Content of a path that is not a scene, for messages.
fn found(kind: &SceneKind) -> String {
    match kind {
        SceneKind::Unknown { found } if found.is_empty() => "an empty folder".to_owned(),
        SceneKind::Unknown { found } => found.join(", "),
        kind => kind.to_string(),
    }
}

/// Whether other flags of the training run may resolve an error of a file that exists.
fn concerns_flags(error: &IoError) -> bool {
    let is_of_model = || {
        error.cause::<Checkpoint4dgsError>().is_some() || error.cause::<Swift4dError>().is_some()
    };
    match error {
        IoError::Format { .. } => is_of_model() && error.cause::<FieldError>().is_none(),
        error => matches!(error, IoError::Content { .. }),
    }
}

/// Opens a dynamic scene or a frame, and reports warnings about it.
pub(crate) fn open_with(
    path: &Path,
    kind: &SceneKind,
    options: &OpenOptions,
    console: &Console,
) -> Outcome<LoadedScene> {
    let has_training_flags = matches!(kind, SceneKind::Model4dgs | SceneKind::Swift4d);
    let opened = gs_io::open_scene_as(path, kind, options).map_err(|error| match &error {
        // The file exists, so flags are the next step.
        IoError::Content { path, .. } | IoError::Format { path, .. }
            if has_training_flags && path.is_file() && concerns_flags(&error) =>
        {
            bad_input(&error).next(
                "Specify flags as --set FLAG=VALUE, repeated for several; c4d --help lists them.",
            )
        }
        _ => bad_input(&error),
    })?;
    for warning in &opened.warnings {
        console.warn(format!("{}: {warning}", path.display()));
    }
    for note in &opened.notes {
        console.note(format!("{}: {note}", path.display()));
    }
    for detail in &opened.details {
        console.detail(format!("{}: {detail}", path.display()));
    }
    Ok(LoadedScene {
        edit_time: opened.scene.time_range().start,
        scene: opened.scene,
        network: opened.deformed,
        kind: opened.kind,
        path: path.to_owned(),
        roots: vec![path.to_owned()],
        original: None,
        mask: Mask::default(),
        source_rows: None,
        binding: None,
        up: opened.up.unwrap_or(UP_CAPTURED),
        fps: opened.fps,
        background: opened.background.unwrap_or([0.0; 3]),
        facts: opened.facts,
        files: opened.files,
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
) -> Outcome<LoadedScene> {
    let run = open_run_within(path, runs, global, console)?;
    let scene = run.scene(path, true)?;
    let Run { config, stored, source } = run;
    let count = |kind| stored.binding.count(kind);
    let rows = format!(
        "{} unchanged, {} recoloured, {} moved, {} blended, {} static{}",
        count(RowKind::Unchanged),
        count(RowKind::Recolored),
        count(RowKind::Moved) + count(RowKind::Copied),
        count(RowKind::Blended),
        count(RowKind::Static),
        match count(RowKind::Descendant) {
            0 => String::new(),
            descendants => format!(", {descendants} inherited"),
        }
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
            format!(
                "{}, baseline {}, motion {}, follow {}",
                config.preset, config.baseline, config.motion, config.follow
            ),
        ),
        ("rows", rows),
        ("refined", refined),
    ];
    let mut files = vec![path.join(SCENE)];
    files.extend(source.files);
    let mut roots = vec![path.to_owned()];
    roots.extend(source.roots);
    Ok(LoadedScene {
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
        binding: Some(Arc::new(stored.binding)),
        mask: config.refine.as_ref().map_or_else(Mask::default, RefineConfig::mask),
        facts,
        files,
    })
}
