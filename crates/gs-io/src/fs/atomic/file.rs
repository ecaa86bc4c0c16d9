//! [`AtomicFile`]: a file that is complete or absent.

use super::existing::{Existing, refuse_special};
use super::reservation::Reservation;
use crate::content::FileContent;
use crate::error::IoError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file that appears under its name only when
/// [`AtomicFile::commit`]ted; if dropped uncommitted, nothing remains.
///
/// With [`Existing::Replace`], a file is replaced only if its content is of the
/// kind being written: an image by an image, a clip by a clip of the same format. A
/// file of a different kind was probably named by mistake.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    existing: Existing,
    writer: Option<BufWriter<File>>,
    reservation: Reservation,
}

impl AtomicFile {
    /// Opens a temporary file next to `path`; creates the folder if it is missing.
    ///
    /// # Errors
    /// If `path` exists and must not be replaced, another process is writing it, or the file cannot
    /// be created.
    pub fn create(path: &Path, existing: Existing) -> Result<Self, IoError> {
        let path: PathBuf = path.components().collect();
        refuse(&path, existing, None)?;
        let reservation = Reservation::take(&path)?;
        refuse(&path, existing, None)?;
        let file = File::create_new(reservation.partial()).map_err(IoError::write(&path))?;
        let writer = Some(BufWriter::with_capacity(1 << 20, file));
        Ok(Self { path, existing, writer, reservation })
    }

    /// Moves the complete file to its name.
    ///
    /// # Errors
    /// If the last bytes cannot be written, or the current content of `path` must not be replaced
    /// by this file.
    pub fn commit(mut self) -> Result<(), IoError> {
        if let Some(writer) = self.writer.take() {
            let file = writer
                .into_inner()
                .map_err(io::IntoInnerError::into_error)
                .map_err(IoError::write(&self.path))?;
            file.sync_all().map_err(IoError::write(&self.path))?;
        }
        refuse(&self.path, self.existing, Some(self.reservation.partial()))?;
        self.reservation.commit_file()
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.writer {
            Some(writer) => writer.write(bytes),
            None => Err(io::Error::other("the file is already complete")),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.as_mut().map_or(Ok(()), Write::flush)
    }
}

/// Fails if the content of `path` must not be replaced at all or, if given, by the complete file
/// `by`.
fn refuse(path: &Path, existing: Existing, by: Option<&Path>) -> Result<(), IoError> {
    let Ok(found) = fs::symlink_metadata(path) else { return Ok(()) };
    refuse_special(path, found.file_type())?;
    if found.is_dir() {
        return Err(IoError::content(path, "is a folder, expected the name of a file"));
    }
    if existing == Existing::Refuse {
        return Err(IoError::Exists { path: super::final_path(path) });
    }
    let content = |path: &Path| {
        FileContent::of(path).map_err(|source| IoError::Read { path: path.to_owned(), source })
    };
    let old = content(path)?;
    let expected = match by {
        Some(by) => content(by)?,
        None => FileContent::of_name(path),
    };
    let fits = match expected {
        _ if old == FileContent::Empty => true,
        // The name is unspecific; the written content is compared later.
        FileContent::Unknown if by.is_none() => old != FileContent::Unknown,
        expected => old == expected && old != FileContent::Unknown,
    };
    if fits {
        return Ok(());
    }
    let what = match expected {
        FileContent::Unknown => format!("contains {old}, which this program does not write"),
        expected => format!("contains {old}, expected {expected}"),
    };
    Err(IoError::Taken {
        path: path.to_owned(),
        what,
        next: "Choose a different name, or move that file elsewhere.".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fs::list_names;

    #[test]
    fn a_file_appears_only_when_complete() {
        let dir = tempfile::tempdir().unwrap();
        let names = || list_names(&dir.path().join("deep")).unwrap();
        let path = dir.path().join("deep/out.ply");
        let mut file = AtomicFile::create(&path, Existing::Refuse).unwrap();
        file.write_all(b"ply half").unwrap();
        drop(file);
        assert!(names().is_empty(), "no partial file remains");
        let mut file = AtomicFile::create(&path, Existing::Refuse).unwrap();
        file.write_all(b"ply whole").unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"ply whole", "content");
        assert!(
            matches!(AtomicFile::create(&path, Existing::Refuse), Err(IoError::Exists { .. })),
            "not twice"
        );
        let mut file = AtomicFile::create(&path, Existing::Replace).unwrap();
        file.write_all(b"ply new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"ply whole", "old until committed");
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"ply new", "replaced");
        assert_eq!(names(), ["out.ply"], "no leftovers");
        let error = AtomicFile::create(&path.join("under/a.bin"), Existing::Refuse).unwrap_err();
        assert!(error.to_string().contains("out.ply: is a file, expected a folder"), "{error}");
    }

    #[test]
    fn only_files_of_the_same_kind_are_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.png");
        fs::write(&path, "dear diary").unwrap();
        let error = AtomicFile::create(&path, Existing::Replace).unwrap_err();
        assert!(error.to_string().contains("expected a PNG image"), "{error}");
        fs::write(&path, b"\x89PNG\r\n\x1a\n and so on").unwrap();
        let mut file = AtomicFile::create(&path, Existing::Replace).unwrap();
        file.write_all(b"no image").unwrap();
        let error = file.commit().unwrap_err();
        assert!(matches!(error, IoError::Taken { .. }), "an image is not replaced by other data");
        assert!(fs::read(&path).unwrap().starts_with(b"\x89PNG"), "untouched");
        let unnamed = dir.path().join("notes");
        fs::write(&unnamed, "dear diary").unwrap();
        let error = AtomicFile::create(&unnamed, Existing::Replace).unwrap_err();
        assert!(error.to_string().contains("does not write"), "{error}");
        fs::write(&unnamed, "").unwrap();
        AtomicFile::create(&unnamed, Existing::Replace).unwrap();
    }

    #[test]
    fn one_process_at_a_time_and_leftovers_are_removed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.bin");
        fs::write(dir.path().join(".out.bin.c4d-partial"), "of a killed process").unwrap();
        fs::write(dir.path().join(".out.bin.c4d-lock"), "").unwrap();
        let mut file = AtomicFile::create(&path, Existing::Refuse).unwrap();
        let second = AtomicFile::create(&path, Existing::Refuse).unwrap_err();
        assert!(matches!(second, IoError::Busy { .. }), "{second}");
        file.write_all(b"whole").unwrap();
        file.commit().unwrap();
        assert_eq!(list_names(dir.path()).unwrap(), ["out.bin"], "nothing else remains");
        assert_eq!(fs::read(&path).unwrap(), b"whole", "only what was written now");
    }

    #[cfg(unix)]
    #[test]
    fn links_and_fifos_are_not_replaced() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let (own, link) = (dir.path().join("own.png"), dir.path().join("link.png"));
        fs::write(&own, b"\x89PNG\r\n\x1a\n").unwrap();
        symlink(&own, &link).unwrap();
        symlink(dir.path().join("nowhere"), dir.path().join("dangling.png")).unwrap();
        let _listener = std::os::unix::net::UnixListener::bind(dir.path().join("socket.png"));
        for (name, needle) in [
            ("link.png", "own.png"),
            ("dangling.png", "does not exist"),
            ("socket.png", "a socket"),
        ] {
            for existing in [Existing::Refuse, Existing::Replace] {
                let error = AtomicFile::create(&dir.path().join(name), existing).unwrap_err();
                assert!(error.to_string().contains(needle), "{name}: {error}");
            }
        }
        let error = AtomicFile::create(Path::new("/dev/null"), Existing::Replace).unwrap_err();
        assert!(error.to_string().contains("a device"), "{error}");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink(), "still a link");
        let error = AtomicFile::create(&dir.path().join("dangling.png/out.ply"), Existing::Refuse)
            .unwrap_err();
        assert!(error.to_string().contains("dangling link"), "{error}");
        symlink(dir.path(), dir.path().join("folder")).unwrap();
        let mut file =
            AtomicFile::create(&dir.path().join("folder/new.ply"), Existing::Refuse).unwrap();
        file.write_all(b"ply").unwrap();
        file.commit().unwrap();
        assert!(dir.path().join("new.ply").is_file(), "a link to a folder is a folder");
    }

    #[test]
    fn names_of_any_length() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ä".repeat(125));
        let mut file = AtomicFile::create(&path, Existing::Refuse).unwrap();
        file.write_all(b"whole").unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole", "written");
        assert!(AtomicFile::create(Path::new("/"), Existing::Replace).is_err(), "no name");
        assert!(AtomicFile::create(dir.path(), Existing::Replace).is_err(), "a folder");
    }
}
