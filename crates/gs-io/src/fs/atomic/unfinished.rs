//! Outputs of this process that are being written.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// An output being written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unfinished {
    pub(super) output: PathBuf,
    pub(super) partial: PathBuf,
    pub(super) lock: PathBuf,
}

/// Outputs of this process that are neither committed nor dropped.
pub(super) static UNFINISHED: Mutex<Vec<Unfinished>> = Mutex::new(Vec::new());

/// Removes the partial files of unfinished outputs of this process. For interrupt handlers, which
/// end the process without dropping them.
pub fn remove_unfinished() {
    const CHECKS: usize = 200;
    const PAUSE: std::time::Duration = std::time::Duration::from_millis(2);
    let Ok(unfinished) = UNFINISHED.lock() else { return };
    for Unfinished { partial, lock, .. } in unfinished.iter() {
        // A thread that is still writing may recreate a file or the folder during removal, so
        // removal is repeated until it stays absent for a while.
        let mut absent = 0;
        for _ in 0..CHECKS {
            if fs::symlink_metadata(partial).is_err() {
                absent += 1;
                if absent > 10 {
                    break;
                }
            } else {
                absent = 0;
                let _ = remove(partial);
            }
            std::thread::sleep(PAUSE);
        }
        let _ = fs::remove_file(lock);
    }
}

/// The final path of an unfinished output of this process, for messages: `out/frame.ply` for
/// `.out.c4d-partial/frame.ply`.
pub fn final_path(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    let Ok(unfinished) = UNFINISHED.lock() else { return path };
    // Outputs may be nested; each is replaced at most once.
    for _ in 0..unfinished.len() {
        // The innermost first, because it is in the partial folder of the outer one.
        let within = unfinished
            .iter()
            .filter_map(|other| Some((&other.output, path.strip_prefix(&other.partial).ok()?)))
            .min_by_key(|(_, rest)| rest.components().count());
        match within {
            Some((output, rest)) if rest.as_os_str().is_empty() => path.clone_from(output),
            Some((output, rest)) => path = output.join(rest),
            None => break,
        }
    }
    path
}

/// Removes a file or a folder; for a link, only the link.
pub(super) fn remove(path: &Path) -> std::io::Result<()> {
    if fs::symlink_metadata(path)?.is_dir() {
        fs::remove_dir_all(path)
    } else {
        fs::remove_file(path)
    }
}
