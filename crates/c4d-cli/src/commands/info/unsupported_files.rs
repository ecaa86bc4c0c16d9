//! Folders of known but unsupported files: rendered images, exports, arrays.

use gs_io::{SceneKind, UnsupportedFormat};
use std::path::{Path, PathBuf};

/// Largest numbers of files and subfolders examined.
const MAX_FILES: usize = 4096;
const MAX_FOLDERS: usize = 64;

/// Contents of a folder, one line per kind, and the next step;
/// `None` if it contains no known files.
pub(super) fn of_folder(path: &Path) -> Option<(Vec<String>, &'static str)> {
    let entries = entries(path);
    let mut found: Vec<(String, UnsupportedFormat, usize)> =
        kinds(&entries).into_iter().map(|(kind, count)| (String::new(), kind, count)).collect();
    // The passes of a render are in separate folders.
    for folder in entries.iter().filter(|entry| entry.is_dir()).take(MAX_FOLDERS) {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let inside = kinds(&self::entries(folder));
        found.extend(inside.into_iter().map(|(kind, count)| (format!("{name}: "), kind, count)));
    }
    let next = found.first()?.1.next;
    let line = |(prefix, kind, count): &(String, UnsupportedFormat, usize)| match count {
        1 => format!("{prefix}1 file, {}", kind.name),
        _ => format!("{prefix}{count} files, each {}", kind.name),
    };
    Some((found.iter().map(line).collect(), next))
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    entries.sort();
    entries
}

/// Known but unsupported formats among `entries`, and the number of files of each.
fn kinds(entries: &[PathBuf]) -> Vec<(UnsupportedFormat, usize)> {
    let mut found: Vec<(UnsupportedFormat, usize)> = Vec::new();
    for file in entries.iter().filter(|entry| entry.is_file()).take(MAX_FILES) {
        let Ok(SceneKind::Unsupported(kind)) = gs_io::detect(file) else { continue };
        match found.iter_mut().find(|(other, _)| *other == kind) {
            Some((_, count)) => *count += 1,
            None => found.push((kind, 1)),
        }
    }
    found
}
