//! Finds the camera files of a path.

use super::{CamerasError, Format, colmap, npy, poses_bounds, rigs};
use crate::cfg_args;
use crate::error::IoError;
use crate::fs::text;
use crate::fs::{list_names, read_bytes, refuse_stand_in};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The camera files found for a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraFiles {
    /// Layout of the files.
    pub format: Format,
    /// The folder of the data set; for `cameras.json` the file.
    pub root: PathBuf,
    /// The only file to read, if a file was given.
    pub file: Option<String>,
    /// How a model folder refers to this data set.
    pub via: Option<String>,
}

impl CameraFiles {
    fn new(format: Format, root: &Path) -> Self {
        Self { format, root: root.to_owned(), file: None, via: None }
    }

    fn in_file(format: Format, path: &Path) -> Self {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
        Self { file: name, ..Self::new(format, parent(path)) }
    }

    /// The NumPy file of poses.
    pub(super) fn poses_file(&self) -> String {
        self.file.clone().unwrap_or_else(|| poses_bounds::FILE.to_owned())
    }
}

fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

/// Error for a path without cameras.
pub(super) fn unknown(path: &Path) -> IoError {
    IoError::content(
        path,
        "contains no cameras; expected cameras.json, transforms_*.json, poses_bounds.npy, a \
        COLMAP model (sparse/0), dataset.json with camera/, frame folders with sparse/0, sparse_ \
        with cam01, …, or a model folder whose cfg_args names such a data set",
    )
}

/// Finds cameras by names and first bytes; `None` if there are none.
///
/// # Errors
/// If the path cannot be read, or is a model folder whose data set is missing.
pub fn find(path: &Path) -> Result<Option<CameraFiles>, IoError> {
    let metadata = std::fs::metadata(path)
        .map_err(|source| IoError::Read { path: path.to_owned(), source })?;
    if !metadata.is_dir() {
        return in_file(path);
    }
    if let Some(found) = data_set(path)? {
        return Ok(Some(found));
    }
    let own = path.join("cameras.json");
    if own.is_file() {
        return Ok(Some(CameraFiles::new(Format::CamerasJson, &own)));
    }
    of_model(path)
}

/// The data set of a folder, tested in the reference's order.
pub(crate) fn data_set(root: &Path) -> Result<Option<CameraFiles>, IoError> {
    let names = list_names(root)?;
    let has = |name: &str| names.iter().any(|found| found == name);
    let holds = |folder: &str| colmap::model_folder(&root.join(folder)).is_some();
    let format = if names.iter().any(|name| rigs::frame_number(name) == Some(0)) {
        Format::FrameFolders
    } else if has("sparse") && colmap::model_folder(root).is_some() {
        Format::Colmap
    } else if names.iter().any(|name| is_transforms(name)) {
        Format::Transforms
    } else if has(poses_bounds::FILE) {
        Format::PosesBounds
    } else if has("dataset.json") && has("camera") {
        Format::Nerfies
    } else if has("sparse_") && holds("sparse_") {
        Format::MultiView
    } else if colmap::model_folder(root).is_some() {
        return Ok(Some(CameraFiles::new(Format::Colmap, &above_model(root))));
    } else {
        return Ok(None);
    };
    Ok(Some(CameraFiles::new(format, root)))
}

fn is_transforms(name: &str) -> bool {
    name == "transforms.json"
        || ["train", "test", "val"].iter().any(|part| name == format!("transforms_{part}.json"))
}

/// The data set of a folder of COLMAP files: the folder that
/// contains `sparse/0`, else the folder itself.
fn above_model(folder: &Path) -> PathBuf {
    let Ok(real) = folder.canonicalize() else { return folder.to_owned() };
    let named = |path: &Path, name: &str| path.file_name().is_some_and(|found| found == name);
    let sparse = if named(&real, "0") { real.parent() } else { Some(real.as_path()) };
    match sparse {
        Some(sparse) if named(sparse, "sparse") => parent(sparse).to_owned(),
        _ => folder.to_owned(),
    }
}

/// Keys that distinguish JSON files.
#[derive(Deserialize)]
struct Keys {
    frames: Option<IgnoredAny>,
    ids: Option<IgnoredAny>,
}

/// Identifies a file by its first bytes; COLMAP's files, which have no magic, by name.
fn in_file(path: &Path) -> Result<Option<CameraFiles>, IoError> {
    let failed = |source| IoError::Read { path: path.to_owned(), source };
    let mut head = Vec::new();
    crate::fs::open_file(path)
        .map_err(failed)?
        .take(4096)
        .read_to_end(&mut head)
        .map_err(failed)?;
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    if npy::is_npy(&head) {
        return Ok(Some(CameraFiles::in_file(Format::PosesBounds, path)));
    }
    if ["cameras.bin", "images.bin", "cameras.txt", "images.txt"].contains(&name.as_str()) {
        return Ok(data_set(parent(path))?.filter(|found| found.format != Format::Transforms));
    }
    refuse_stand_in(path, &head)?;
    let head = text::utf8(&head);
    let is_text = head.iter().all(|byte| *byte >= b' ' || byte.is_ascii_whitespace());
    match head.trim_ascii_start().first().filter(|_| is_text) {
        Some(b'[') => Ok(Some(CameraFiles::new(Format::CamerasJson, path))),
        Some(b'{') => {
            let keys: Keys = serde_json::from_slice(&text::json(&read_bytes(path)?))
                .map_err(CamerasError::json("JSON file"))
                .map_err(IoError::format(path))?;
            Ok(if keys.frames.is_some() {
                Some(CameraFiles::in_file(Format::Transforms, path))
            } else if keys.ids.is_some() {
                Some(CameraFiles::new(Format::Nerfies, parent(path)))
            } else {
                None
            })
        }
        _ => Ok(None),
    }
}

/// The data set named in the `cfg_args` of a model folder: at the path as given, next to the model,
/// or in a parent folder.
fn of_model(model: &Path) -> Result<Option<CameraFiles>, IoError> {
    let path = model.join("cfg_args");
    if !path.is_file() {
        return Ok(None);
    }
    let args =
        cfg_args::parse(&text::decode(&read_bytes(&path)?)).map_err(IoError::format(&path))?;
    let Some(named) = args.get("source_path").and_then(cfg_args::Value::as_str) else {
        return Ok(None);
    };
    let real = model.canonicalize().unwrap_or_else(|_unreadable| model.to_owned());
    let places = std::iter::once(PathBuf::new()).chain(real.ancestors().map(Path::to_owned));
    for place in places {
        let root = place.join(named);
        if root.is_dir()
            && let Some(found) = data_set(&root)?
        {
            let via = Some(format!(
                "{} names the data set {}",
                model.join("cfg_args").display(),
                root.display()
            ));
            return Ok(Some(CameraFiles { via, ..found }));
        }
    }
    Err(IoError::content(
        model,
        format!(
            "is a model without cameras: its cfg_args names the data set `{named}`, which does \
            not exist; use the data set's folder or a cameras.json"
        ),
    ))
}
