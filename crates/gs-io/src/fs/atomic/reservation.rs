//! [`Reservation`]: the right to write one output, exclusive to one process at a time.

use super::unfinished::{UNFINISHED, Unfinished, final_path, remove};
use crate::error::IoError;
use same_file::Handle;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Extensions of the hidden names, explained in the parent module.
const LOCK: &str = ".c4d-lock";
const PARTIAL: &str = ".c4d-partial";
const REPLACED: &str = ".c4d-replaced";
/// Longest output name that hidden names contain completely,
/// bytes; file systems allow 255 bytes per name.
const MAX_WHOLE_NAME: usize = 200;

/// Whether a name is one used by a [`Reservation`].
pub(super) fn is_temporary(name: &str) -> bool {
    name.starts_with('.') && [LOCK, PARTIAL, REPLACED].iter().any(|ending| name.ends_with(ending))
}

/// The right to write one output. When dropped, it removes an uncommitted output.
#[derive(Debug)]
pub(super) struct Reservation {
    names: Unfinished,
    replaced: PathBuf,
    /// Holds the lock while open.
    _lock: File,
}

impl Reservation {
    /// Acquires the right to write `path`, creates its parent folder, and cleans up after processes
    /// that were killed while writing it: a folder that was being replaced is restored.
    pub(super) fn take(path: &Path) -> Result<Self, IoError> {
        let name = path.file_name().ok_or_else(|| {
            IoError::content(path, "is not the name of a file or folder that can be written")
        })?;
        make_parent(path)?;
        let hidden = |ending| path.with_file_name(hidden_name(name, ending));
        let names =
            Unfinished { output: path.to_owned(), partial: hidden(PARTIAL), lock: hidden(LOCK) };
        let lock = lock(path, &names.lock)?;
        let reservation = Self { names, replaced: hidden(REPLACED), _lock: lock };
        if let Ok(mut unfinished) = UNFINISHED.lock() {
            unfinished.push(reservation.names.clone());
        }
        reservation.tidy().map_err(IoError::write(path))?;
        Ok(reservation)
    }

    /// Path to write to.
    pub(super) fn partial(&self) -> &Path {
        &self.names.partial
    }

    fn tidy(&self) -> std::io::Result<()> {
        for stale in [&self.replaced, &self.names.partial] {
            let Ok(found) = fs::symlink_metadata(stale) else { continue };
            if stale == &self.replaced
                && found.is_dir()
                && fs::symlink_metadata(&self.names.output).is_err()
            {
                fs::rename(stale, &self.names.output)?;
            } else {
                remove(stale)?;
            }
        }
        Ok(())
    }

    /// Moves the complete file to its name.
    pub(super) fn commit_file(self) -> Result<(), IoError> {
        let Unfinished { output, partial, .. } = &self.names;
        fs::rename(partial, output).map_err(IoError::write(output))
    }

    /// Moves the complete folder to its name. Previous content is removed only after that, and only
    /// if `may_replace` still allows it.
    pub(super) fn commit_folder(
        self,
        may_replace: impl Fn(&Path) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        let Unfinished { output, partial, .. } = &self.names;
        let failed = |source| IoError::Write { path: final_path(output), source };
        if fs::symlink_metadata(output).is_err() {
            return fs::rename(partial, output).map_err(failed);
        }
        if exchange(partial, output) {
            if let Err(error) = may_replace(partial) {
                exchange(partial, output);
                return Err(error);
            }
            return fs::remove_dir_all(partial).map_err(failed);
        }
        fs::rename(output, &self.replaced).map_err(failed)?;
        let put_back = || fs::rename(&self.replaced, output);
        if let Err(error) = fs::rename(partial, output) {
            // Best effort: the first failure is returned either way.
            let _ = put_back();
            return Err(failed(error));
        }
        if let Err(error) = may_replace(&self.replaced) {
            fs::rename(output, partial).and_then(|()| put_back()).map_err(failed)?;
            return Err(error);
        }
        fs::remove_dir_all(&self.replaced).map_err(failed)
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        // After a commit nothing has this name; before it, a failed
        // removal cannot be reported from here.
        let _ = remove(&self.names.partial);
        let _ = fs::remove_file(&self.names.lock);
        if let Ok(mut unfinished) = UNFINISHED.lock() {
            unfinished.retain(|other| other != &self.names);
        }
    }
}

/// Swaps two folders atomically where the system supports it, so that a killed process leaves
/// either the old or the new one.
#[cfg(target_os = "linux")]
fn exchange(one: &Path, other: &Path) -> bool {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE).is_ok()
}

/// Swaps two folders atomically where the system supports it; not supported here.
#[cfg(not(target_os = "linux"))]
fn exchange(_one: &Path, _other: &Path) -> bool {
    false
}

/// `.NAME` with an extension; long names are replaced by their start and a checksum.
pub(super) fn hidden_name(name: &OsStr, ending: &str) -> OsString {
    let mut hidden = OsString::from(".");
    if name.len() <= MAX_WHOLE_NAME {
        hidden.push(name);
    } else {
        let start: String = name.to_string_lossy().chars().take(MAX_WHOLE_NAME / 8).collect();
        hidden.push(format!("{start}-{:08x}", crc32fast::hash(name.as_encoded_bytes())));
    }
    hidden.push(ending);
    hidden
}

/// Opens and locks `path`, the lock of `output`.
fn lock(output: &Path, path: &Path) -> Result<File, IoError> {
    let failed = |source| IoError::Write { path: final_path(output), source };
    loop {
        // Only a regular file can be the lock; opening a FIFO would block.
        if let Ok(found) = fs::symlink_metadata(path)
            && !found.is_file()
        {
            return Err(IoError::content(
                path,
                "has the name of a lock file but is not a regular file; remove it",
            ));
        }
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(IoError::Busy { path: final_path(output) });
            }
            // Some network file systems do not support locks; writing
            // without one is better than failing.
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        // The previous holder may have removed the file after it was opened
        // here; then this lock has no effect on others.
        let own = file.try_clone().and_then(Handle::from_file).map_err(failed)?;
        if Handle::from_path(path).is_ok_and(|there| there == own) {
            return Ok(file);
        }
    }
}

/// Creates the parent folder of `path`.
fn make_parent(path: &Path) -> Result<(), IoError> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => {
            let there = |ancestor: &&Path| fs::symlink_metadata(ancestor).is_ok();
            if let Some(found) = parent.ancestors().find(there)
                && !found.is_dir()
            {
                let what = if found.is_symlink() {
                    "is a dangling link, expected a folder to write into"
                } else {
                    "is a file, expected a folder to write into"
                };
                return Err(IoError::content(found, what));
            }
            fs::create_dir_all(parent).map_err(IoError::write(parent))
        }
        _ => Ok(()),
    }
}
