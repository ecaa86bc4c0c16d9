//! [`FolderUpdate`]: replaces single files of a folder that this program wrote.

use super::existing::refuse_special;
use super::record::{Record, RecordLocation, Stamp};
use super::reservation::Reservation;
use crate::error::IoError;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A folder written by [`super::AtomicDir`] whose files are rewritten in place; each file is either
/// new and complete, or unchanged. While this exists, no other process can write to the folder.
#[derive(Debug)]
pub struct FolderUpdate {
    folder: PathBuf,
    _reservation: Reservation,
}

impl FolderUpdate {
    /// Begins the update of the folder `given`, which may be a link to a folder.
    ///
    /// # Errors
    /// If it is not a folder, cannot be written to, or another process is writing it.
    pub fn begin(given: &Path) -> Result<Self, IoError> {
        let folder = given
            .canonicalize()
            .map_err(|source| IoError::Read { path: given.to_owned(), source })?;
        if !folder.is_dir() {
            return Err(IoError::content(given, "is not a folder"));
        }
        let reservation = Reservation::take(&folder)?;
        // Tested before the work, not after it.
        let record = RecordLocation::Inside.of(&folder);
        Record::default().append(&record).map_err(IoError::write(given))?;
        Ok(Self { folder, _reservation: reservation })
    }

    /// Writes the file `name` of the folder. An existing file is replaced if this program wrote it,
    /// or if the caller `has_read` it and rewrites its content.
    ///
    /// # Errors
    /// If it must not be replaced, or cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8], has_read: bool) -> Result<(), IoError> {
        let path = self.folder.join(name);
        let record = RecordLocation::Inside.of(&self.folder);
        let failed = |source| IoError::Write { path: path.clone(), source };
        if let Ok(found) = fs::symlink_metadata(&path) {
            refuse_special(&path, found.file_type())?;
            if found.is_dir() {
                return Err(IoError::content(&path, "is a folder, expected a file"));
            }
            let stamp = Stamp::of_file(&path).map_err(failed)?;
            if !has_read && !Record::read(&record).contains(name, stamp) {
                return Err(IoError::UnrecordedEntry {
                    path: self.folder.clone(),
                    entry: name.to_owned(),
                    what: "was not written by it, or was changed since",
                });
            }
        }
        let reservation = Reservation::take(&path)?;
        Record::of_one(name, Stamp::of_bytes(bytes)).append(&record).map_err(failed)?;
        let mut file = File::create_new(reservation.partial()).map_err(failed)?;
        file.write_all(bytes).and_then(|()| file.sync_all()).map_err(failed)?;
        drop(file);
        reservation.commit_file()
    }

    /// Opens the file `name` of the folder for reading and appending; creates it if it is missing.
    /// Its content is not compared with the record, because it grows while it is written.
    ///
    /// # Errors
    /// If the name is taken by something else, or the file cannot be opened.
    pub fn growing(&self, name: &str) -> Result<File, IoError> {
        let path = self.folder.join(name);
        let record = RecordLocation::Inside.of(&self.folder);
        let failed = |source| IoError::Write { path: path.clone(), source };
        let known = Record::read(&record).contains(name, Stamp::GROWING);
        if let Ok(found) = fs::symlink_metadata(&path) {
            refuse_special(&path, found.file_type())?;
            if !known {
                return Err(IoError::UnrecordedEntry {
                    path: self.folder.clone(),
                    entry: name.to_owned(),
                    what: "was not written by it",
                });
            }
        }
        if !known {
            Record::of_one(name, Stamp::GROWING).append(&record).map_err(failed)?;
        }
        File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(failed)
    }

    /// Removes the file `name` of the folder, if it exists.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn remove(&self, name: &str) -> Result<(), IoError> {
        let path = self.folder.join(name);
        match fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                Err(IoError::Write { path, source })
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AtomicDir, Existing};

    #[test]
    fn an_updated_folder_can_still_be_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let outer = AtomicDir::create(&dir.path().join("outer"), Existing::Refuse).unwrap();
        let inner = AtomicDir::create(&outer.path().join("run"), Existing::Refuse).unwrap();
        fs::write(inner.path().join("scene"), "one").unwrap();
        inner.commit().unwrap();
        outer.commit().unwrap();
        let run = dir.path().join("outer/run");
        let update = FolderUpdate::begin(&run).unwrap();
        update.write("scene", b"other", false).unwrap();
        update.write("previews/0.png", b"image", false).unwrap();
        update.growing("log").unwrap().write_all(b"a line").unwrap();
        update.growing("mine").unwrap();
        let busy = AtomicDir::create(&run, Existing::Replace).unwrap_err();
        assert!(matches!(busy, IoError::Busy { .. }), "one at a time: {busy}");
        drop(update);
        fs::write(run.join(".state.c4d-partial"), "of a killed process").unwrap();
        for path in [run.as_path(), &dir.path().join("outer")] {
            drop(AtomicDir::create(path, Existing::Replace).unwrap());
        }
        fs::write(run.join("scene"), "of the user").unwrap();
        let update = FolderUpdate::begin(&run).unwrap();
        assert!(
            matches!(update.write("scene", b"", false), Err(IoError::UnrecordedEntry { .. })),
            "theirs"
        );
        update.write("scene", b"merged", true).unwrap();
        update.remove("previews/0.png").unwrap();
        update.remove("previews/0.png").unwrap();
        assert_eq!(fs::read(run.join("scene")).unwrap(), b"merged", "written");
    }
}
