//! [`open_scene`]: a scene of any kind from its path.

use crate::detect::detect;
use crate::error::IoError;
use crate::frame;
use crate::model_folder::{self, Overrides};
use crate::open_source::open_source;
use crate::ply_sequence::{PlySequence, SequenceOptions};
use crate::repair::{self, Damage};
use crate::scene_kind::SceneKind;
use crate::source::SourceOptions;
use crate::{checkpoint4dgs, splat4d, splatv, swift4d};
use gs_core::DynamicScene;
use gs_deform::StaticScene;
use std::path::Path;

/// Most entries of a folder that a warning lists.
const MAX_SHOWN: usize = 8;

/// How to open a scene of any kind.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OpenOptions {
    /// For models of 4DGaussians and Swift4D.
    pub overrides: Overrides,
    /// For other trained scenes; their iteration is that of `overrides`.
    pub source: SourceOptions,
    /// For every kind.
    pub damage: Damage,
}

/// A scene of any kind.
#[derive(Debug)]
pub struct OpenedScene {
    /// The scene.
    pub scene: Box<dyn DynamicScene>,
    /// What it was made from.
    pub kind: SceneKind,
    /// What was found, for model folders.
    pub report: Option<model_folder::ModelReport>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Opens a trained scene, a sequence of frames, a `.splatv` or `.splat4d` file, or a single frame
/// of any format (which never moves).
///
/// # Errors
/// If the path is something else, or as the readers of its kind.
pub fn open_scene(path: impl AsRef<Path>, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let path = path.as_ref();
    let kind = detect(path)?;
    let mut warnings = Vec::new();
    let damaged = |report: repair::RepairReport| {
        report.warning(options.damage == Damage::Drop).into_iter().chain(report.infinities.note())
    };
    let mut report = None;
    let scene: Box<dyn DynamicScene> = match kind {
        SceneKind::Model4dgs | SceneKind::Swift4d => {
            let overrides = Overrides { damage: options.damage, ..options.overrides };
            let model = if kind == SceneKind::Swift4d {
                swift4d::open(path, &overrides)?
            } else {
                checkpoint4dgs::open(path, &overrides)?
            };
            warnings.clone_from(&model.report.warnings);
            warnings.extend(model.report.notes.iter().cloned());
            report = Some(model.report);
            Box::new(model.scene)
        }
        SceneKind::PlySequence => {
            let sequence_options =
                SequenceOptions { damage: options.damage, ..SequenceOptions::default() };
            let sequence = PlySequence::open(path, &sequence_options)?;
            warnings.extend(sequence.notes()?);
            warnings.extend(sequence.series().map(str::to_owned));
            warnings.extend(damaged(sequence.repair()));
            if !sequence.ignored().is_empty() {
                warnings.push(format!(
                    "{} other entries of the folder were ignored: {}",
                    sequence.ignored().len(),
                    sequence.ignored()[..sequence.ignored().len().min(MAX_SHOWN)].join(", ")
                ));
            }
            Box::new(sequence)
        }
        SceneKind::Splatv => {
            let read = splatv::open(path, options.damage)?;
            warnings.extend(damaged(read.repair));
            Box::new(read.scene)
        }
        SceneKind::Splat4d => {
            let read = splat4d::open(path, options.damage)?;
            warnings.extend(damaged(read.repair));
            Box::new(read.scene)
        }
        SceneKind::Deformable3dgs
        | SceneKind::Scgs
        | SceneKind::Grid4d
        | SceneKind::Dash
        | SceneKind::Ed3dgs
        | SceneKind::Dynamic3dgs
        | SceneKind::Spacetime
        | SceneKind::FreeTime
        | SceneKind::Fourdgs
        | SceneKind::Gaussian4d => {
            let source_options = SourceOptions {
                iteration: options.overrides.iteration,
                damage: options.damage,
                ..options.source
            };
            let source = open_source(path, &kind, &source_options)?;
            warnings.extend(source.warnings);
            warnings.extend(source.notes);
            warnings.extend(damaged(source.repair));
            source.scene
        }
        SceneKind::Ply
        | SceneKind::CompressedPly
        | SceneKind::Splat
        | SceneKind::Spz
        | SceneKind::Sog
        | SceneKind::Gltf
        | SceneKind::Gsplat
        | SceneKind::EditorFolder
        | SceneKind::Model3dgs
        | SceneKind::OtherPly(_) => {
            let read = frame::read_file(path)?;
            warnings.extend(read.notes.iter().cloned());
            warnings.extend(read.axes.and_then(|reading| reading.assumption()));
            let (frame, found) = read
                .sanitize(options.damage)
                .map_err(|source| IoError::Damaged { path: path.to_owned(), source })?;
            warnings.extend(damaged(found));
            let scene = StaticScene::new(frame.splats)
                .map_err(|error| IoError::content(path, error.to_string()))?;
            Box::new(scene)
        }
        SceneKind::RunFolder
        | SceneKind::Cameras(_)
        | SceneKind::Unsupported(_)
        | SceneKind::Unknown { .. } => {
            return Err(IoError::content(
                path,
                format!(
                    "is not a scene ({kind}); expected a trained dynamic scene (a model folder or checkpoint), numbered frames in a folder or zip archive, a .splatv or .splat4d clip, or one frame (PLY, .splat, .spz, .sog, .glb)"
                ),
            ));
        }
    };
    Ok(OpenedScene { scene, kind, report, warnings })
}
