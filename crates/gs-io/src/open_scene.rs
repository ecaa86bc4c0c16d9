//! [`open_scene()`]: opens a scene of any kind.

use crate::detect::detect;
use crate::error::IoError;
use crate::frame;
use crate::model_folder::{Overrides, opened};
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::ply::comments;
use crate::ply_sequence::{PlySequence, SequenceOptions};
use crate::repair::Damage;
use crate::scene_kind::SceneKind;
use crate::{
    checkpoint4dgs, deformable3dgs, dynamic3dgs, ed3dgs, fourdgs_file, freetime, gaussian4d,
    grid4d, scgs, spacetime, splat4d, splatv, swift4d, tsog,
};
use gs_core::DynamicScene;
use gs_deform::StaticScene;
use std::path::Path;

/// Largest number of folder entries listed in a warning.
const MAX_SHOWN: usize = 8;
/// Share of the distance between unrelated rows above which the rows of a sequence count as not
/// persistent.
const MAX_DRIFT: f32 = 0.3;
/// Width in time above which splats of a `.splatv` count as visible throughout; the clip has
/// duration 1.
const ALWAYS_VISIBLE: f32 = 10.0;

/// Opens a trained scene, a sequence of frames, a clip (`.splatv`, `.splat4d`, `.4dgs`, `.tsog`),
/// or a single frame of any format (as a static scene).
///
/// # Errors
/// If the path is of a different kind, or its reader fails.
pub fn open_scene(path: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    open_scene_as(path, &detect(path)?, options)
}

/// As [`open_scene()`], for a path whose kind is known.
///
/// # Errors
/// If the kind is not a scene, or its reader fails.
pub fn open_scene_as(
    path: &Path,
    kind: &SceneKind,
    options: &OpenOptions,
) -> Result<OpenedScene, IoError> {
    let mut opened = match kind {
        SceneKind::Model4dgs | SceneKind::Swift4d => {
            let overrides = Overrides {
                iteration: options.iteration,
                damage: options.damage,
                ..options.overrides
            };
            let is_swift4d = *kind == SceneKind::Swift4d;
            let read = if is_swift4d { swift4d::open } else { checkpoint4dgs::open };
            return Ok(opened(path, kind.clone(), read(path, &overrides)?));
        }
        SceneKind::PlySequence => open_sequence(path, options),
        SceneKind::Splatv => open_splatv(path, options.damage),
        SceneKind::Splat4d => open_splat4d(path, options.damage),
        SceneKind::Deformable3dgs => deformable3dgs::open(path, options),
        SceneKind::Scgs => scgs::open(path, options),
        SceneKind::Grid4d => grid4d::open(path, options),
        SceneKind::Dash => grid4d::open_dash(path, options),
        SceneKind::Ed3dgs => ed3dgs::open(path, options),
        SceneKind::Dynamic3dgs => dynamic3dgs::open(path, options),
        SceneKind::Spacetime => spacetime::open(path, options),
        SceneKind::FreeTime => freetime::open(path, options),
        SceneKind::Fourdgs => fourdgs_file::open(path, options),
        SceneKind::Tsog => tsog::open(path, options),
        SceneKind::Gaussian4d => gaussian4d::open(path, options),
        SceneKind::Ply
        | SceneKind::CompressedPly
        | SceneKind::Splat
        | SceneKind::Spz
        | SceneKind::Sog
        | SceneKind::Gltf
        | SceneKind::Gsplat
        | SceneKind::EditorFolder
        | SceneKind::Model3dgs
        | SceneKind::OtherPly(_) => open_frame(path, kind.clone(), options),
        SceneKind::RunFolder
        | SceneKind::Cameras(_)
        | SceneKind::Unsupported(_)
        | SceneKind::Unknown { .. } => {
            return Err(IoError::content(
                path,
                format!(
                    "is not a scene ({kind}); expected a trained dynamic scene (a model folder or checkpoint), numbered frames in a folder or zip archive, a .splatv, .splat4d, .4dgs or .tsog clip, or one frame (PLY, .splat, .spz, .sog, .glb)"
                ),
            ));
        }
    }?;
    opened.warnings.extend(opened.repair.warning(options.damage == Damage::Drop));
    opened.notes.extend(opened.repair.infinities.note());
    Ok(opened)
}

fn open_sequence(path: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let sequence_options = SequenceOptions {
        damage: options.damage,
        axes: options.axes,
        ..SequenceOptions::default()
    };
    let sequence = PlySequence::open(path, &sequence_options)?;
    let series = sequence.series().map(str::to_owned);
    let mut facts = vec![("frames", sequence.num_frames().unwrap_or_default().to_string())];
    facts.extend(series.iter().map(|series| ("series", series.clone())));
    let mut warnings = Vec::new();
    let drift = sequence.row_drift()?;
    if drift > MAX_DRIFT {
        warnings.push(format!(
            "rows hardly persist from frame to frame (they move {:.0} % of the distance of unrelated rows): frames whose rows an editor or converter sorted again are not a scene",
            100.0 * drift
        ));
    }
    let ignored = sequence.ignored();
    let details = (!ignored.is_empty()).then(|| {
        let shown = ignored[..ignored.len().min(MAX_SHOWN)].join(", ");
        let more = if ignored.len() > MAX_SHOWN { ", …" } else { "" };
        format!("{} other entries were ignored: {shown}{more}", ignored.len())
    });
    let files = sequence.paths().to_vec();
    let first = files.first();
    Ok(OpenedScene {
        facts,
        warnings,
        notes: series.into_iter().chain(sequence.notes()?).collect(),
        details: details.into_iter().collect(),
        repair: sequence.repair(),
        up: first.and_then(|first| comments::up_of(first)),
        fps: first.and_then(|first| comments::fps_of(first)),
        ..OpenedScene::new(SceneKind::PlySequence, sequence, files)
    })
}

fn open_splatv(path: &Path, damage: Damage) -> Result<OpenedScene, IoError> {
    let read = splatv::open(path, damage)?;
    let widths = read.scene.motions().iter().map(|motion| motion.width);
    let always = widths.filter(|&width| width > ALWAYS_VISIBLE).count();
    Ok(OpenedScene {
        facts: vec![
            ("motion", "one cubic per splat".to_owned()),
            ("always visible", always.to_string()),
        ],
        repair: read.repair,
        up: read.up,
        ..OpenedScene::new(SceneKind::Splatv, read.scene, vec![path.to_owned()])
    })
}

fn open_splat4d(path: &Path, damage: Damage) -> Result<OpenedScene, IoError> {
    let read = splat4d::open(path, damage)?;
    Ok(OpenedScene {
        facts: vec![
            ("frames", read.scene.num_frames().unwrap_or_default().to_string()),
            ("fps", read.fps.to_string()),
        ],
        repair: read.repair,
        up: read.up,
        fps: Some(read.fps),
        ..OpenedScene::new(SceneKind::Splat4d, read.scene, vec![path.to_owned()])
    })
}

fn open_frame(path: &Path, kind: SceneKind, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let mut read = frame::read_file(path)?;
    if let Some(axes) = options.axes {
        read = read.in_axes(axes);
    }
    let assumed = read.axes.and_then(|reading| reading.assumption());
    let assumed = assumed.map(|what| format!("{what}; if it appears upside down, use --axes ply"));
    let notes = read.notes.iter().cloned().chain(assumed).collect();
    let up = read.comments.iter().find_map(|comment| comment.strip_prefix(comments::UP));
    let up = up.and_then(comments::axis);
    let (frame, repair) = read.sanitize(options.damage).map_err(IoError::damaged(path))?;
    let scene = StaticScene::new(frame.splats)
        .map_err(|error| IoError::content(path, error.to_string()))?;
    let files = vec![frame::file_of(path)];
    Ok(OpenedScene { notes, repair, up, ..OpenedScene::new(kind, scene, files) })
}
