//! Suggestions for paths that are not what a command needs.

use gs_io::SceneKind;
use std::path::{Path, PathBuf};

/// Largest number of folder entries examined.
const MAX_ENTRIES: usize = 256;
/// Largest number of entries listed.
const SHOWN: usize = 6;
/// Folders between a model or data set and its innermost files.
const DEPTH: usize = 4;

/// Kind of input that a command needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Needed {
    /// A dynamic scene.
    Scene,
    /// An edited frame.
    Frame,
}

impl Needed {
    fn fits(self, kind: &SceneKind) -> bool {
        match self {
            Self::Frame => kind.is_frame(),
            Self::Scene => kind.is_dynamic() || *kind == SceneKind::RunFolder,
        }
    }
}

/// Suggests suitable paths in the folder `path`, or the folder around it, if there are any.
pub(crate) fn for_path(path: &Path, needed: Needed) -> Option<String> {
    if path.is_dir() { inside(path, needed) } else { around(path, needed) }
}

fn inside(folder: &Path, needed: Needed) -> Option<String> {
    let found = entries(folder, needed);
    let named = |(path, kind): &(PathBuf, SceneKind)| format!("{} ({kind})", path.display());
    match &found[..] {
        [] => None,
        [only] => Some(format!("The folder contains {}: use that path.", named(only))),
        several => {
            let mut names: Vec<String> = several.iter().take(SHOWN).map(named).collect();
            if several.len() > SHOWN {
                names.push(format!("{} more", several.len() - SHOWN));
            }
            Some(format!("The folder contains {}: use one of these paths.", names.join(", ")))
        }
    }
}

/// Fitting entries of a folder, or of the unknown folders in it if it has none.
fn entries(folder: &Path, needed: Needed) -> Vec<(PathBuf, SceneKind)> {
    let unknown = |path: &PathBuf| matches!(gs_io::detect(path), Ok(SceneKind::Unknown { .. }));
    let mut folders = vec![folder.to_owned()];
    for _ in 0..DEPTH {
        let mut paths: Vec<PathBuf> = folders
            .iter()
            .filter_map(|folder| std::fs::read_dir(folder).ok())
            .flat_map(|entries| entries.flatten().map(|entry| entry.path()).take(MAX_ENTRIES))
            .take(MAX_ENTRIES)
            .collect();
        paths.sort();
        let found = fitting(&paths, needed);
        if !found.is_empty() || !folders.iter().all(unknown) {
            return found;
        }
        paths.retain(|path| path.is_dir() && !path.is_symlink() && unknown(path));
        folders = paths;
    }
    Vec::new()
}

fn fitting(paths: &[PathBuf], needed: Needed) -> Vec<(PathBuf, SceneKind)> {
    let fitting = |path: &PathBuf| {
        // Only plain files and folders, because reading a pipe would block.
        let plain = path.metadata().is_ok_and(|found| found.is_file() || found.is_dir());
        let kind = plain.then(|| gs_io::detect(path).ok())??;
        needed.fits(&kind).then(|| (path.clone(), kind))
    };
    paths.iter().filter_map(fitting).collect()
}

fn around(file: &Path, needed: Needed) -> Option<String> {
    let file = file.canonicalize().ok()?;
    let known = |folder: &&Path| gs_io::detect(folder).is_ok_and(|kind| needed.fits(&kind));
    let folder = file.ancestors().skip(1).take(DEPTH).filter(known).last()?;
    let kind = gs_io::detect(folder).ok()?;
    Some(format!("It belongs to {} ({kind}): use that folder.", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn suitable_paths_are_suggested() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(for_path(dir.path(), Needed::Scene), None, "the folder is empty");
        fs::write(dir.path().join("notes.txt"), "hello").unwrap();
        fs::write(dir.path().join("walk.splatv"), 0x674B_u32.to_le_bytes()).unwrap();
        let message = for_path(dir.path(), Needed::Scene).unwrap();
        assert!(message.contains("walk.splatv") && message.contains("use that"), "{message}");
        assert_eq!(for_path(dir.path(), Needed::Frame), None, "a clip is not a frame");
        fs::write(dir.path().join("wave.splat4d"), "SP4D").unwrap();
        let message = for_path(dir.path(), Needed::Scene).unwrap();
        assert!(
            message.contains("wave.splat4d") && message.contains("one of these paths"),
            "{message}"
        );
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("output/exp1");
        fs::create_dir_all(&inner).unwrap();
        fs::write(inner.join("walk.splatv"), 0x674B_u32.to_le_bytes()).unwrap();
        let message = for_path(outer.path(), Needed::Scene).unwrap();
        assert!(message.contains("exp1") && message.contains("walk.splatv"), "deeper: {message}");
    }
}
