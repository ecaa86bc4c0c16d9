//! Folders in which editors leave one frame.

use super::{Frame, read};
use crate::error::{IoError, read_bytes};
use crate::sog;
use std::path::{Path, PathBuf};

/// Where the frame lies, best first: runs of GaussianEditor and DGE (threestudio), their `save` folder, and `c4d freeze`.
const PLACES: [&str; 3] = ["save/last.ply", "last.ply", "point_cloud.ply"];

/// The file that holds the frame of a folder.
pub(crate) fn still_of(folder: &Path) -> Option<PathBuf> {
    let meta = folder.join("meta.json");
    let sog = (meta.is_file() && folder.join("means_l.webp").is_file()).then_some(meta);
    PLACES.iter().map(|place| folder.join(place)).find(|path| path.is_file()).or(sog)
}

pub(super) fn read_dir(folder: &Path) -> Result<Frame, IoError> {
    let Some(path) = still_of(folder) else {
        return Err(IoError::content(
            folder,
            format!("is a folder without an edited frame: it has none of {}", PLACES.join(", ")),
        ));
    };
    if path.ends_with("meta.json") {
        let meta = read_bytes(&path)?;
        // Planes are named by the file, and must lie beside it.
        let plane = |name: &str| {
            let plain = Path::new(name).file_name().is_some_and(|file| file == name);
            let bytes = plain.then(|| read_bytes(&folder.join(name))).and_then(Result::ok);
            bytes.ok_or_else(|| format!("its plane {name} is missing"))
        };
        return sog::read_planes(&meta, &plane).map_err(IoError::frame(&path));
    }
    read(&read_bytes(&path)?).map_err(IoError::frame(&path))
}
