//! What a path is, from its names and first bytes alone.

use crate::archive::Archive;
use crate::cameras;
use crate::checkpoint4dgs;
use crate::error::IoError;
use crate::foreign::{Foreign, MANIFEST, MANIFEST_ENDING, NUMPY_ARCHIVE, TORCH_ARCHIVE};
use crate::frame::{self, Container};
use crate::input::list_names;
use crate::model_folder::{self, Overrides};
use crate::ply::{self, PlyError};
use crate::ply_sequence::{PlySequence, SequenceOptions, find_frames};
use crate::repair::{self, Damage};
use crate::splat4d;
use crate::splatv;
use crate::swift4d;
use gs_core::DynamicScene;
use gs_deform::StaticScene;
use std::fmt::{self, Display};
use std::path::Path;

/// What a path holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SceneKind {
    /// A model folder of 4DGaussians.
    Model4dgs,
    /// A model folder of Swift4D.
    Swift4d,
    /// A model folder of plain 3DGS, whose newest save is one frame.
    Model3dgs,
    /// Numbered frames in a folder or a zip archive.
    PlySequence,
    /// A 3DGS PLY file.
    Ply,
    /// A PLY file compressed by PlayCanvas tools.
    CompressedPly,
    /// A `.splat` frame.
    Splat,
    /// An `.spz` frame.
    Spz,
    /// A `.sog` frame.
    Sog,
    /// A `.glb` or `.gltf` frame.
    Gltf,
    /// A folder in which an editor left a frame.
    EditorFolder,
    /// A PLY file of something else; why it is no Gaussian scene.
    OtherPly(String),
    /// A `.splatv` file: splats that move along cubics of time.
    Splatv,
    /// A `.splat4d` clip.
    Splat4d,
    /// The output folder of an earlier run.
    RunFolder,
    /// Cameras of a data set, without splats.
    Cameras(cameras::Format),
    /// A file that is known but not read here.
    Foreign(Foreign),
    /// Something else.
    Unknown {
        /// What was found there.
        found: Vec<String>,
    },
}

impl Display for SceneKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Model4dgs => f.write_str("4DGaussians model folder"),
            Self::Swift4d => f.write_str("Swift4D model folder"),
            Self::Model3dgs => f.write_str("3DGS model folder (static, no deformation)"),
            Self::PlySequence => f.write_str("PLY sequence"),
            Self::Ply => f.write_str("3D Gaussian PLY"),
            Self::CompressedPly => f.write_str("PlayCanvas compressed PLY"),
            Self::Splat => f.write_str(".splat frame"),
            Self::Spz => f.write_str("SPZ frame"),
            Self::Sog => f.write_str("SOG frame"),
            Self::Gltf => f.write_str("glTF frame"),
            Self::EditorFolder => f.write_str("folder with one edited frame"),
            Self::OtherPly(what) => f.write_str(what),
            Self::Splatv => f.write_str("animated splats (.splatv)"),
            Self::Splat4d => f.write_str("compressed clip (.splat4d)"),
            Self::RunFolder => f.write_str("run folder"),
            Self::Cameras(format) => write!(f, "{format}"),
            Self::Foreign(foreign) => f.write_str(foreign.name),
            Self::Unknown { found } if found.is_empty() => f.write_str("unknown: an empty folder"),
            Self::Unknown { found } => {
                write!(f, "unknown: found {}", found.join(", "))
            }
        }
    }
}

impl SceneKind {
    /// Whether it is one frame of Gaussians, which [`frame::read_file`] reads.
    pub fn is_frame(&self) -> bool {
        matches!(
            self,
            Self::Ply
                | Self::CompressedPly
                | Self::Splat
                | Self::Spz
                | Self::Sog
                | Self::Gltf
                | Self::EditorFolder
                | Self::Model3dgs
        )
    }
}

/// Names shown of a folder that is nothing known.
const SHOWN: usize = 8;

/// Says what a path is. Reads names and headers, not the data.
///
/// # Errors
/// If the path does not exist or cannot be read.
pub fn detect(path: impl AsRef<Path>) -> Result<SceneKind, IoError> {
    let path = path.as_ref();
    let metadata = std::fs::metadata(path)
        .map_err(|source| IoError::Read { path: path.to_owned(), source })?;
    if metadata.is_dir() { detect_folder(path) } else { detect_file(path) }
}

fn detect_folder(path: &Path) -> Result<SceneKind, IoError> {
    let mut names = list_names(path)?;
    names.retain(|name| !crate::atomic::is_bookkeeping(name));
    let has = |name: &str| names.iter().any(|found| found == name);
    if has("c4d.toml") || has("scene.c4d") {
        return Ok(SceneKind::RunFolder);
    }
    if swift4d::looks_like_model(path) {
        return Ok(SceneKind::Swift4d);
    }
    if model_folder::still_model(path).is_some() {
        return Ok(SceneKind::Model3dgs);
    }
    if model_folder::looks_like_model(path) {
        return Ok(SceneKind::Model4dgs);
    }
    if let Some(found) = cameras::data_set(path)? {
        return Ok(SceneKind::Cameras(found.format));
    }
    // A folder with gaps in its numbers is still a sequence; opening it says what is missing.
    if find_frames(&names).map_or(true, |found| found.frames.len() >= 2) {
        return Ok(SceneKind::PlySequence);
    }
    if frame::still_of_folder(path).is_some() {
        return Ok(SceneKind::EditorFolder);
    }
    if has("cameras.json") && !names.iter().any(|name| cameras::has_extension(name, "ply")) {
        return Ok(SceneKind::Cameras(cameras::Format::CamerasJson));
    }
    let mut found: Vec<String> = names.iter().take(SHOWN).cloned().collect();
    if names.len() > SHOWN {
        found.push(format!("{} more", names.len() - SHOWN));
    }
    Ok(SceneKind::Unknown { found })
}

/// Bytes of a file looked at where its first ones are no PLY header.
const START: u64 = 16 << 10;

fn detect_file(path: &Path) -> Result<SceneKind, IoError> {
    let failed = |source| IoError::Read { path: path.to_owned(), source };
    let file = crate::input::open_file(path).map_err(failed)?;
    let mut start = Vec::new();
    std::io::Read::read_to_end(&mut std::io::Read::take(file, START), &mut start)
        .map_err(failed)?;
    if start.starts_with(&splatv::MAGIC) {
        return Ok(SceneKind::Splatv);
    }
    if start.starts_with(&splat4d::MAGIC) {
        return Ok(SceneKind::Splat4d);
    }
    let container = frame::container(&start);
    // Text and arrays can look like rows of a `.splat`. Malformed JSON is nothing known; opening it as cameras says where it breaks.
    if matches!(container, Container::Splat | Container::Unknown)
        && let Ok(Some(cameras)) = cameras::find(path)
    {
        return Ok(SceneKind::Cameras(cameras.format));
    }
    match container {
        Container::Ply => detect_ply(path),
        Container::Spz => Ok(SceneKind::Spz),
        Container::Splat => Ok(SceneKind::Splat),
        Container::Gltf => Ok(SceneKind::Gltf),
        Container::Zip => Ok(detect_zip(path)),
        Container::Unknown if path.to_string_lossy().ends_with(MANIFEST_ENDING) => {
            Ok(SceneKind::Foreign(MANIFEST))
        }
        Container::Unknown => Ok(Foreign::of(&start).map_or_else(
            || SceneKind::Unknown { found: vec![frame::shown(&start)] },
            SceneKind::Foreign,
        )),
    }
}

fn detect_ply(path: &Path) -> Result<SceneKind, IoError> {
    let read = ply::read_header_file(path);
    match read.and_then(|header| header.gaussians().map_err(IoError::ply(path))) {
        Ok(_) => Ok(SceneKind::Ply),
        Err(IoError::Ply { source: PlyError::Compressed, .. }) => Ok(SceneKind::CompressedPly),
        Err(IoError::Ply { source, .. }) => Ok(SceneKind::OtherPly(source.to_string())),
        Err(other) => Err(other),
    }
}

/// SOG, a sequence, or what else an archive holds.
fn detect_zip(path: &Path) -> SceneKind {
    let unknown = |what: String| SceneKind::Unknown { found: vec![what] };
    let names = match archive_names(path) {
        Ok(names) => names,
        Err(what) => {
            return unknown(format!("a damaged zip archive ({what}): copy or export it again"));
        }
    };
    if names.iter().any(|name| name == "meta.json" || name.ends_with("/meta.json")) {
        return SceneKind::Sog;
    }
    if find_frames(&names).map_or(true, |found| found.frames.len() >= 2) {
        return SceneKind::PlySequence;
    }
    if names.iter().any(|name| name == "data.pkl" || name.ends_with("/data.pkl")) {
        return SceneKind::Foreign(TORCH_ARCHIVE);
    }
    if !names.is_empty() && names.iter().all(|name| cameras::has_extension(name, "npy")) {
        return SceneKind::Foreign(NUMPY_ARCHIVE);
    }
    let shown: Vec<&str> = names.iter().map(String::as_str).take(SHOWN).collect();
    unknown(format!("a zip archive with {}", shown.join(", ")))
}

fn archive_names(path: &Path) -> Result<Vec<String>, String> {
    let file = crate::input::open_file(path).map_err(|error| error.to_string())?;
    Ok(Archive::open(std::io::BufReader::new(file))?.names().to_vec())
}

/// How to open a scene of any kind.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OpenOptions {
    /// For models of 4DGaussians and Swift4D.
    pub overrides: Overrides,
    /// For every kind.
    pub damage: Damage,
}

/// A scene of any kind.
#[derive(Debug)]
pub struct Opened {
    /// The scene.
    pub scene: Box<dyn DynamicScene>,
    /// What it was made from.
    pub kind: SceneKind,
    /// What was found, for model folders.
    pub report: Option<model_folder::ModelReport>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Opens a model of 4DGaussians or Swift4D, a sequence of frames, a `.splatv` or `.splat4d` file, or a single frame of any format (which never moves).
///
/// # Errors
/// If the path is something else, or as the readers of its kind.
pub fn open_scene(path: impl AsRef<Path>, options: &OpenOptions) -> Result<Opened, IoError> {
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
                    sequence.ignored()[..sequence.ignored().len().min(SHOWN)].join(", ")
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
        SceneKind::Ply
        | SceneKind::CompressedPly
        | SceneKind::Splat
        | SceneKind::Spz
        | SceneKind::Sog
        | SceneKind::Gltf
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
        | SceneKind::Foreign(_)
        | SceneKind::Unknown { .. } => {
            return Err(IoError::content(
                path,
                format!(
                    "is not a scene ({kind}); expected a model folder of 4DGaussians or Swift4D, numbered frames in a folder or zip archive, a .splatv or .splat4d clip, or one frame (PLY, .splat, .spz, .sog, .glb)"
                ),
            ));
        }
    };
    Ok(Opened { scene, kind, report, warnings })
}
