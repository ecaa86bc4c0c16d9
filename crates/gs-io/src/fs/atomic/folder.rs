//! [`AtomicDir`]: a folder that is complete or absent.

use super::existing::{Existing, refuse_special};
use super::record::{Compare, Record, RecordLocation, unrecorded_entry};
use super::reservation::Reservation;
use crate::error::IoError;
use crate::fs::list_names;
use std::fs;
use std::path::{Path, PathBuf};

/// A folder that appears under its name only when
/// [`AtomicDir::commit`]ted; if dropped uncommitted, nothing remains.
///
/// An existing empty folder is always replaced. One with content is replaced only with
/// [`Existing::Replace`], and only if this program wrote every file in it, at every depth, and none
/// has changed since. Names, sizes and checksums of its files are stored in a record, `.c4d-files`.
#[derive(Debug)]
pub struct AtomicDir {
    path: PathBuf,
    existing: Existing,
    record: RecordLocation,
    reservation: Reservation,
}

impl AtomicDir {
    /// Creates a temporary folder next to `path`.
    ///
    /// # Errors
    /// If `path` exists and must not be replaced, another process is writing it, or the folder
    /// cannot be created.
    pub fn create(path: &Path, existing: Existing) -> Result<Self, IoError> {
        Self::with_record(path, existing, RecordLocation::Inside)
    }

    /// As [`AtomicDir::create`], with the record next to the folder, for formats whose readers
    /// interpret every file of a folder.
    ///
    /// # Errors
    /// As [`AtomicDir::create`].
    pub fn create_bare(path: &Path, existing: Existing) -> Result<Self, IoError> {
        Self::with_record(path, existing, RecordLocation::NextTo)
    }

    fn with_record(
        path: &Path,
        existing: Existing,
        record: RecordLocation,
    ) -> Result<Self, IoError> {
        let path: PathBuf = path.components().collect();
        refuse(&path, existing)?;
        let reservation = Reservation::take(&path)?;
        refuse(&path, existing)?;
        fs::create_dir(reservation.partial()).map_err(IoError::write(&path))?;
        Ok(Self { path, existing, record, reservation })
    }

    /// The temporary folder to write into.
    pub fn path(&self) -> &Path {
        self.reservation.partial()
    }

    /// Moves the complete folder to its name; previous content
    /// is removed only after that succeeded.
    ///
    /// # Errors
    /// If renaming fails, or the current content of `path` must not be replaced.
    pub fn commit(self) -> Result<(), IoError> {
        let Self { path, existing, record, reservation } = self;
        let failed = |source| IoError::Write { path: super::final_path(&path), source };
        let files = Record::of_folder(reservation.partial()).map_err(failed)?;
        let next_to = RecordLocation::NextTo.of(&path);
        match record {
            RecordLocation::Inside => {
                files.write(&RecordLocation::Inside.of(reservation.partial())).map_err(failed)?;
            }
            RecordLocation::NextTo => files.append(&next_to).map_err(failed)?,
        }
        refuse(&path, existing)?;
        reservation.commit_folder(|old| may_replace(old, &path, Compare::Sizes))?;
        match record {
            RecordLocation::Inside => {
                // Best effort: a leftover record of a removed folder is harmless.
                let _ = fs::remove_file(next_to);
                Ok(())
            }
            RecordLocation::NextTo => files.write(&next_to).map_err(failed),
        }
    }
}

/// Fails if the content of `path` must not be replaced.
fn refuse(path: &Path, existing: Existing) -> Result<(), IoError> {
    let Ok(found) = fs::symlink_metadata(path) else { return Ok(()) };
    refuse_special(path, found.file_type())?;
    if !found.is_dir() {
        return Err(IoError::content(path, "is a file, expected the name of a folder"));
    }
    if is_mount_point(path, &found) {
        return Err(IoError::Taken {
            path: path.to_owned(),
            what: "is a mount point and cannot be replaced".to_owned(),
            next: format!("Use a folder inside it, such as {}.", path.join("NAME").display()),
        });
    }
    if list_names(path)?.is_empty() {
        return Ok(());
    }
    if existing == Existing::Refuse {
        return Err(IoError::Exists { path: super::final_path(path) });
    }
    may_replace(path, path, Compare::Content)
}

/// Whether the folder `path` is a mount point, to which nothing can be renamed.
#[cfg(unix)]
fn is_mount_point(path: &Path, found: &fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    let parent = path.canonicalize().ok().and_then(|path| fs::metadata(path.parent()?).ok());
    parent.is_some_and(|parent| parent.dev() != found.dev())
}

/// Whether the folder `path` is a mount point; not tested on systems with drive letters.
#[cfg(not(unix))]
fn is_mount_point(_path: &Path, _found: &fs::Metadata) -> bool {
    false
}

/// Fails if `folder`, the current or previous content of `output`, has entries that this program
/// did not write, so that it must not be removed.
fn may_replace(folder: &Path, output: &Path, compare: Compare) -> Result<(), IoError> {
    let failed = |source| IoError::Read { path: output.to_owned(), source };
    match unrecorded_entry(folder, output, compare).map_err(failed)? {
        Some(found) => Err(IoError::UnrecordedEntry {
            path: super::final_path(output),
            entry: found.entry,
            what: found.what,
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(path: &Path) -> Vec<String> {
        list_names(path).unwrap()
    }

    fn write(path: &Path, existing: Existing, files: &[(&str, &str)]) -> Result<(), IoError> {
        let folder = AtomicDir::create(path, existing)?;
        for (name, text) in files {
            let file = folder.path().join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, text).unwrap();
        }
        folder.commit()
    }

    #[test]
    fn a_folder_appears_only_when_complete() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out");
        let folder = AtomicDir::create(&path, Existing::Refuse).unwrap();
        fs::write(folder.path().join("frame_0"), b"x").unwrap();
        let second = AtomicDir::create(&path, Existing::Refuse).unwrap_err();
        assert!(matches!(second, IoError::Busy { .. }), "one at a time: {second}");
        drop(folder);
        assert!(names(dir.path()).is_empty(), "no partial folder remains");
        write(&path, Existing::Refuse, &[("frame_0", "x")]).unwrap();
        assert_eq!(names(&path), [".c4d-files", "frame_0"], "complete");
        assert!(
            matches!(AtomicDir::create(&path, Existing::Refuse), Err(IoError::Exists { .. })),
            "not twice"
        );
        write(&path, Existing::Replace, &[("deep/frame_1", "y")]).unwrap();
        assert_eq!(names(&path), [".c4d-files", "deep"], "replaced");
        assert_eq!(names(dir.path()), ["out"], "no leftovers");
    }

    #[test]
    fn only_folders_of_this_program_are_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out");
        let files = [("a.png", "ours"), ("deep/b.png", "ours, too")];
        let refused = |change: &dyn Fn(), entry: &str, what: &str| {
            let _ = fs::remove_dir_all(&path);
            write(&path, Existing::Refuse, &files).unwrap();
            change();
            let error = write(&path, Existing::Replace, &files).unwrap_err();
            let IoError::UnrecordedEntry { entry: found, what: why, .. } = &error else {
                panic!("{error}")
            };
            assert_eq!((found.as_str(), *why), (entry, what), "{error}");
            assert!(names(dir.path()) == ["out"], "no leftovers: {:?}", names(dir.path()));
        };
        let put = |name: &str, text: &str| fs::write(path.join(name), text).unwrap();
        refused(&|| put("notes.txt", "mine"), "notes.txt", "was not written by it");
        refused(&|| put("deep/c.png", "mine"), "deep/c.png", "was not written by it");
        refused(&|| put("deep/b.png", "mine now!"), "deep/b.png", "was changed since");
        refused(&|| put("a.png", "longer than it was"), "a.png", "was changed since");
        let make = || fs::create_dir(path.join("empty")).unwrap();
        refused(&make, "empty", "was not written by it");
        #[cfg(unix)]
        {
            let link = || std::os::unix::fs::symlink("a.png", path.join("z.png")).unwrap();
            refused(&link, "z.png", "is a link");
        }
        // Without its record a folder is unknown.
        let forget = || fs::remove_file(path.join(".c4d-files")).unwrap();
        refused(&forget, "a.png", "was not written by it");
        fs::remove_dir_all(&path).unwrap();
        fs::create_dir(&path).unwrap();
        write(&path, Existing::Refuse, &files).unwrap();
    }

    #[test]
    fn an_interrupted_replacement_is_restored() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out");
        write(&path, Existing::Refuse, &[("a", "old")]).unwrap();
        fs::rename(&path, dir.path().join(".out.c4d-replaced")).unwrap();
        fs::create_dir(dir.path().join(".out.c4d-partial")).unwrap();
        let error = write(&path, Existing::Refuse, &[("a", "new")]).unwrap_err();
        assert!(matches!(error, IoError::Exists { .. }), "the old one is restored: {error}");
        assert_eq!(names(dir.path()), ["out"], "no leftovers");
        write(&path, Existing::Replace, &[("a", "new")]).unwrap();
        assert_eq!(fs::read(path.join("a")).unwrap(), b"new", "replaced");
    }

    #[test]
    fn a_record_may_be_next_to_the_folder() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out");
        let write = |text: &str| {
            let folder = AtomicDir::create_bare(&path, Existing::Replace)?;
            fs::write(folder.path().join("frame_0"), text).unwrap();
            folder.commit()
        };
        write("one").unwrap();
        write("other").unwrap();
        assert_eq!(names(&path), ["frame_0"], "only frames");
        assert_eq!(names(dir.path()), [".out.c4d-files", "out"], "next to the folder");
        fs::write(path.join("frame_0"), "edited").unwrap();
        let error = write("third").unwrap_err().to_string();
        assert!(error.contains("`frame_0`") && error.contains("was changed"), "{error}");
    }

    #[test]
    fn messages_name_the_output_not_the_temporary_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.v2");
        let folder = AtomicDir::create(&path, Existing::Refuse).unwrap();
        let inside = folder.path().join("rgb/00000.png");
        assert_ne!(inside, path.join("rgb/00000.png"), "written elsewhere");
        assert_eq!(
            crate::final_path(&inside),
            path.join("rgb/00000.png"),
            "named by its final \
            path"
        );
        let nested = AtomicDir::create(&folder.path().join("run"), Existing::Refuse).unwrap();
        assert_eq!(crate::final_path(&nested.path().join("a")), path.join("run/a"), "nested");
        for plain in ["a/.hidden/b.c", "/x/y.z", "rel", "../up"] {
            assert_eq!(crate::final_path(Path::new(plain)), Path::new(plain), "left alone");
        }
    }

    #[test]
    fn files_are_not_folders() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("f"), b"").unwrap();
        assert!(AtomicDir::create(&dir.path().join("f"), Existing::Replace).is_err(), "a file");
        #[cfg(target_os = "linux")]
        {
            let error = AtomicDir::create(Path::new("/proc"), Existing::Replace).unwrap_err();
            assert!(error.to_string().contains("a mount point"), "{error}");
        }
        #[cfg(unix)]
        {
            let (target, link) = (dir.path().join("target"), dir.path().join("link"));
            write(&target, Existing::Refuse, &[("a", "x")]).unwrap();
            std::os::unix::fs::symlink(&target, &link).unwrap();
            let error = AtomicDir::create(&link, Existing::Replace).unwrap_err();
            assert!(error.to_string().contains("target"), "{error}");
        }
    }
}
