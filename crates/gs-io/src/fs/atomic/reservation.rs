//! [`Reservation`]: the right to write one output, held by one process at a time.

use super::unfinished::{UNFINISHED, Unfinished, final_path, remove};
use crate::error::IoError;
use same_file::Handle;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Endings of the hidden names; their reason is in the module above.
const LOCK: &str = ".c4d-lock";
const PARTIAL: &str = ".c4d-partial";
const REPLACED: &str = ".c4d-replaced";
/// Longest name of an output whose hidden names contain it whole, bytes: file systems allow 255 for
/// a name.
const MAX_WHOLE_NAME: usize = 200;

/// Whether a name is one that a [`Reservation`] makes.
pub(super) fn is_temporary(name: &str) -> bool {
    name.starts_with('.') && [LOCK, PARTIAL, REPLACED].iter().any(|ending| name.ends_with(ending))
}

/// The right to write one output. Dropped, it removes what is not in place yet.
#[derive(Debug)]
pub(super) struct Reservation {
    names: Unfinished,
    replaced: PathBuf,
    /// Keeps the lock for as long as it is open.
    _lock: File,
}

impl Reservation {
    /// Takes the right to write `path`, makes the folder it goes into, and tidies up after
    /// processes that were killed while they wrote it: a folder that was being replaced is put
    /// back.
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

    /// Where to write.
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

    /// Puts the complete file under its name.
    pub(super) fn commit_file(self) -> Result<(), IoError> {
        let Unfinished { output, partial, .. } = &self.names;
        fs::rename(partial, output).map_err(IoError::write(output))
    }

    /// Puts the complete folder under its name. What was there is removed only after that, and only
    /// if `may_go` still agrees.
    pub(super) fn commit_folder(
        self,
        may_go: impl Fn(&Path) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        let Unfinished { output, partial, .. } = &self.names;
        let failed = |source| IoError::Write { path: final_path(output), source };
        if fs::symlink_metadata(output).is_err() {
            return fs::rename(partial, output).map_err(failed);
        }
        if exchange(partial, output) {
            if let Err(error) = may_go(partial) {
                exchange(partial, output);
                return Err(error);
            }
            return fs::remove_dir_all(partial).map_err(failed);
        }
        fs::rename(output, &self.replaced).map_err(failed)?;
        let put_back = || fs::rename(&self.replaced, output);
        if let Err(error) = fs::rename(partial, output) {
            // Best effort: the caller hears about the first failure either way.
            let _ = put_back();
            return Err(failed(error));
        }
        if let Err(error) = may_go(&self.replaced) {
            fs::rename(output, partial).and_then(|()| put_back()).map_err(failed)?;
            return Err(error);
        }
        fs::remove_dir_all(&self.replaced).map_err(failed)
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        // After a commit there is nothing under this name; otherwise a failed removal cannot be
        // reported from here.
        let _ = remove(&self.names.partial);
        let _ = fs::remove_file(&self.names.lock);
        if let Ok(mut unfinished) = UNFINISHED.lock() {
            unfinished.retain(|other| other != &self.names);
        }
    }
}

/// Swaps two folders in one step, where the system can: a process that is killed leaves the old one
/// or the new one, never neither.
#[cfg(target_os = "linux")]
fn exchange(one: &Path, other: &Path) -> bool {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE).is_ok()
}

/// Swaps two folders in one step, where the system can.
#[cfg(not(target_os = "linux"))]
fn exchange(_one: &Path, _other: &Path) -> bool {
    false
}

/// `.NAME` with an ending; of long names the start and a checksum.
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
        // Whatever else has this name is in the way; a FIFO would not even open.
        if let Ok(found) = fs::symlink_metadata(path)
            && !found.is_file()
        {
            return Err(IoError::content(path, "is in the way of a lock file; remove it"));
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
            // Some network file systems have no locks: better without one than not at all.
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        // Whoever held it before may have removed it after it was opened here: then this is a lock
        // that nobody else will see.
        let own = file.try_clone().and_then(Handle::from_file).map_err(failed)?;
        if Handle::from_path(path).is_ok_and(|there| there == own) {
            return Ok(file);
        }
    }
}

/// Makes the folder that `path` goes into.
fn make_parent(path: &Path) -> Result<(), IoError> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => {
            let there = |ancestor: &&Path| fs::symlink_metadata(ancestor).is_ok();
            if let Some(found) = parent.ancestors().find(there)
                && !found.is_dir()
            {
                let what = if found.is_symlink() {
                    "is a link that leads nowhere, expected a folder to write into"
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
