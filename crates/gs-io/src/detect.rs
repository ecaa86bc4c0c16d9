//! Detects the kind of a path from names and first bytes.

use crate::archive::Archive;
use crate::cameras;
use crate::content::{
    Container, MANIFEST, MANIFEST_ENDING, NUMPY_ARCHIVE, UnsupportedFormat, container, magic,
    shown, torch_archive,
};
use crate::deform_folder::{self, Method};
use crate::error::IoError;
use crate::frame;
use crate::fs::list_names;
use crate::model_folder;
use crate::ply::{self, PlyError};
use crate::ply_sequence::find_frames;
use crate::scene_kind::SceneKind;
use crate::{dynamic3dgs, ed3dgs, freetime, gaussian4d, gsplat, spacetime, swift4d, tsog};
use std::io::BufReader;
use std::path::Path;

/// Number of entries listed for a folder of unknown kind.
const SHOWN: usize = 8;

/// Detects the kind of a path. Reads names and headers, not the data.
///
/// # Errors
/// If the path does not exist or cannot be read.
pub fn detect(path: &Path) -> Result<SceneKind, IoError> {
    let metadata = std::fs::metadata(path)
        .map_err(|source| IoError::Read { path: path.to_owned(), source })?;
    if metadata.is_dir() { detect_folder(path) } else { detect_file(path) }
}

fn detect_folder(path: &Path) -> Result<SceneKind, IoError> {
    let mut names = list_names(path)?;
    names.retain(|name| !crate::fs::is_bookkeeping(name));
    let has = |name: &str| names.iter().any(|found| found == name);
    if has("c4d.toml") || has("scene.c4d") {
        return Ok(SceneKind::RunFolder);
    }
    if let Some(method) = deform_folder::method_of(path) {
        return Ok(match method {
            Method::Deformable3dgs => SceneKind::Deformable3dgs,
            Method::Scgs => SceneKind::Scgs,
            Method::Grid4d => SceneKind::Grid4d,
            Method::Dash => SceneKind::Dash,
        });
    }
    if ed3dgs::looks_like_model(path) {
        return Ok(SceneKind::Ed3dgs);
    }
    if dynamic3dgs::file_of(path).is_some() {
        return Ok(SceneKind::Dynamic3dgs);
    }
    if gaussian4d::looks_like_model(path) {
        return Ok(SceneKind::Gaussian4d);
    }
    if swift4d::looks_like_model(path) {
        return Ok(SceneKind::Swift4d);
    }
    if let Some(ply) = model_folder::still_model(path) {
        return Ok(match detect_ply(&ply) {
            Ok(SceneKind::Spacetime) => SceneKind::Spacetime,
            _ => SceneKind::Model3dgs,
        });
    }
    if model_folder::looks_like_model(path) {
        return Ok(SceneKind::Model4dgs);
    }
    if let Some(found) = cameras::data_set(path)? {
        return Ok(SceneKind::Cameras(found.format));
    }
    // The reader reports which part of the model is missing.
    if model_folder::has_network(path) {
        return Ok(SceneKind::Model4dgs);
    }
    // A folder with missing numbers is still a sequence; opening it reports what is missing.
    if find_frames(&names).map_or(true, |found| found.frames.len() >= 2) {
        return Ok(SceneKind::PlySequence);
    }
    if frame::still_of_folder(path).is_some() {
        return Ok(SceneKind::EditorFolder);
    }
    if has("cameras.json") && !names.iter().any(|name| cameras::has_extension(name, "ply")) {
        return Ok(SceneKind::Cameras(cameras::Format::CamerasJson));
    }
    let mut found: Vec<String> = names.iter().take(SHOWN).map(|name| entry(path, name)).collect();
    if names.len() > SHOWN {
        found.push(format!("{} more", names.len() - SHOWN));
    }
    Ok(SceneKind::Unknown { found })
}

/// An entry of a folder of unknown kind, with the missing parts of a model.
fn entry(folder: &Path, name: &str) -> String {
    let path = folder.join(name);
    let is_empty = std::fs::metadata(&path).is_ok_and(|found| found.is_file() && found.len() == 0);
    if is_empty {
        format!("{name}, which is empty: copy it again")
    } else if name == "point_cloud"
        && path.is_dir()
        && !model_folder::has_in_iterations(folder, "point_cloud.ply")
    {
        "point_cloud without iteration_N/point_cloud.ply: copy that file from the machine that trained the model"
            .to_owned()
    } else {
        name.to_owned()
    }
}

/// Number of bytes examined of a file without a PLY header.
const START: u64 = 16 << 10;

fn detect_file(path: &Path) -> Result<SceneKind, IoError> {
    let failed = |source| IoError::Read { path: path.to_owned(), source };
    let file = crate::fs::open_file(path).map_err(failed)?;
    let mut start = Vec::new();
    std::io::Read::read_to_end(&mut std::io::Read::take(file, START), &mut start)
        .map_err(failed)?;
    if start.starts_with(&magic::SPLATV) {
        return Ok(SceneKind::Splatv);
    }
    if start.starts_with(&magic::FOURDGS) {
        return Ok(SceneKind::Fourdgs);
    }
    if start.starts_with(&magic::SPLAT4D) {
        return Ok(SceneKind::Splat4d);
    }
    let container = container(&start);
    // Text and arrays can look like rows of a `.splat`. Malformed JSON is of unknown kind; opening
    // it as cameras reports the error.
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
        Container::Zip => Ok(detect_torch(&start).unwrap_or_else(|| detect_zip(path, &start))),
        Container::Unknown if path.to_string_lossy().ends_with(MANIFEST_ENDING) => {
            Ok(SceneKind::Unsupported(MANIFEST))
        }
        Container::Unknown => Ok(UnsupportedFormat::of(&start).map_or_else(
            || SceneKind::Unknown { found: vec![shown(&start)] },
            SceneKind::Unsupported,
        )),
    }
}

fn detect_ply(path: &Path) -> Result<SceneKind, IoError> {
    let read = ply::read_header_file(path);
    let layout = read.and_then(|header| header.gaussians().map_err(IoError::format(path)));
    match layout {
        Ok(layout) if spacetime::has_columns(&layout.extra_columns) => Ok(SceneKind::Spacetime),
        Ok(layout) if freetime::has_columns(&layout.extra_columns) => Ok(SceneKind::FreeTime),
        Ok(_) => Ok(SceneKind::Ply),
        Err(error) => match error.cause::<PlyError>() {
            Some(PlyError::Compressed) => Ok(SceneKind::CompressedPly),
            Some(other) => Ok(SceneKind::OtherPly(other.to_string())),
            None => Err(error),
        },
    }
}

/// Kind of a PyTorch archive that is a complete scene.
fn detect_torch(start: &[u8]) -> Option<SceneKind> {
    if gaussian4d::is_checkpoint(start) {
        return Some(SceneKind::Gaussian4d);
    }
    Some(match gsplat::contents(start)? {
        gsplat::Contents::Still => SceneKind::Gsplat,
        gsplat::Contents::Moving => SceneKind::FreeTime,
    })
}

/// Largest size of the metadata of SOG and TSOG, bytes.
const META_LIMIT: u64 = 4 << 20;

/// Kind of a zip archive: SOG, TSOG, a sequence, or something else.
fn detect_zip(path: &Path, start: &[u8]) -> SceneKind {
    let unknown = |what: String| SceneKind::Unknown { found: vec![what] };
    let opened = crate::fs::open_file(path).map_err(|error| error.to_string());
    let mut archive = match opened.and_then(|file| Archive::open(BufReader::new(file))) {
        Ok(archive) => archive,
        Err(what) => {
            return unknown(format!("a damaged zip archive ({what}): copy or export it again"));
        }
    };
    let names = archive.names().to_vec();
    if let Some(meta) = names.iter().find(|name| tsog::is_meta(name)) {
        // Damaged metadata are reported by the reader of SOG.
        let is_timed = archive.read(meta, META_LIMIT).is_ok_and(|meta| tsog::is_timed(&meta));
        return if is_timed { SceneKind::Tsog } else { SceneKind::Sog };
    }
    if find_frames(&names).map_or(true, |found| found.frames.len() >= 2) {
        return SceneKind::PlySequence;
    }
    if names.iter().any(|name| name == "data.pkl" || name.ends_with("/data.pkl")) {
        return SceneKind::Unsupported(torch_archive(start));
    }
    if dynamic3dgs::is_archive(&names) {
        return SceneKind::Dynamic3dgs;
    }
    if !names.is_empty() && names.iter().all(|name| cameras::has_extension(name, "npy")) {
        return SceneKind::Unsupported(NUMPY_ARCHIVE);
    }
    let shown: Vec<&str> = names.iter().map(String::as_str).take(SHOWN).collect();
    unknown(format!("a zip archive with {}", shown.join(", ")))
}
