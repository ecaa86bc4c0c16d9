//! Folders in which editors write one frame.

use crate::fs::read_bytes;
use crate::fs::text;
use crate::model_folder::still_model;
use serde_json::{Map, Value};
use std::path::{Component, Path, PathBuf};

/// Paths of the frame, in order of preference: runs of GaussianEditor and DGE (threestudio), their
/// `save` folder, and `c4d freeze`.
pub(super) const PLACES: [&str; 3] = ["save/last.ply", "last.ply", "point_cloud.ply"];

/// The file with the frame of a folder: an editor's output, an
/// unbundled SOG, or the newest save of a 3DGS model.
pub(crate) fn still_of(folder: &Path) -> Option<PathBuf> {
    let meta = folder.join("meta.json");
    let sog = || (meta.is_file() && is_sog(folder, &meta)).then(|| meta.clone());
    let placed = PLACES.iter().map(|place| folder.join(place)).find(|path| path.is_file());
    placed.or_else(sog).or_else(|| still_model(folder))
}

/// Whether a `meta.json` belongs to a SOG, by its planes or its content.
fn is_sog(folder: &Path, meta: &Path) -> bool {
    /// Larger files are not SOG metadata.
    const MAX_META: u64 = 1 << 20;
    let small = || std::fs::metadata(meta).is_ok_and(|meta| meta.len() <= MAX_META);
    let lists_planes = || {
        let keys: Option<Map<String, Value>> = crate::fs::read_file(meta)
            .ok()
            .and_then(|bytes| serde_json::from_slice(&text::json(&bytes)).ok());
        keys.is_some_and(|keys| ["means", "quats", "sh0"].iter().all(|key| keys.contains_key(*key)))
    };
    folder.join("means_l.webp").is_file() || (small() && lists_planes())
}

/// The bytes of a file referenced by a relative URI in `folder`; the URI may
/// be percent-encoded but must not contain `..`.
pub(super) fn read_referenced(folder: &Path, uri: &str) -> Result<Vec<u8>, String> {
    let name = decoded(uri);
    let inside = Path::new(&name).components().all(|part| matches!(part, Component::Normal(_)));
    if !inside || name.is_empty() || name.contains(':') {
        return Err(format!("its data are at `{uri}`, which is not in its folder"));
    }
    let path = folder.join(&name);
    if !path.is_file() {
        return Err(format!("its data file {} is missing", path.display()));
    }
    read_bytes(&path).map_err(|error| error.to_string())
}

/// A URI without percent escapes.
fn decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        let escape = (*first == b'%').then(|| after.first_chunk::<2>()).flatten();
        let byte = escape
            .and_then(|hex| std::str::from_utf8(hex).ok())
            .and_then(|hex| u8::from_str_radix(hex, 16).ok());
        bytes.push(byte.unwrap_or(*first));
        rest = if byte.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The file that [`read_file`](super::read_file) reads: the path itself, or the one in the folder.
pub fn file_of(path: &Path) -> PathBuf {
    let inside = if path.is_dir() { still_of(path) } else { None };
    inside.unwrap_or_else(|| path.to_owned())
}
