//! Outputs that are complete or absent: written under a temporary name, renamed when done.

use crate::error::{IoError, list_names};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// What to do when the output exists.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Existing {
    /// Fail before anything is written.
    #[default]
    Refuse,
    /// Replace it when the new one is complete.
    Replace,
}

/// Makes temporary names of one process unique.
static COUNTER: AtomicU64 = AtomicU64::new(0);

/// Temporary files and folders of outputs that are neither committed nor dropped.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes what unfinished outputs of this process have written so far: for the handler of an interrupt, which ends the process
/// without dropping them.
pub fn remove_unfinished() {
    const CHECKS: usize = 200;
    const PAUSE: std::time::Duration = std::time::Duration::from_millis(2);
    let Ok(unfinished) = UNFINISHED.lock() else { return };
    for path in unfinished.iter() {
        // A thread that is still writing may put a file, or the folder itself, back while it is being removed: done when it
        // has stayed away for a while.
        let mut absent = 0;
        for _ in 0..CHECKS {
            if fs::symlink_metadata(path).is_err() {
                absent += 1;
                if absent > 10 {
                    break;
                }
            } else {
                absent = 0;
                let _ =
                    if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
            }
            std::thread::sleep(PAUSE);
        }
    }
}

fn register(path: &Path) {
    if let Ok(mut unfinished) = UNFINISHED.lock() {
        unfinished.push(path.to_owned());
    }
}

fn unregister(path: &Path) {
    if let Ok(mut unfinished) = UNFINISHED.lock() {
        unfinished.retain(|other| other != path);
    }
}

/// A hidden sibling of `path`: same file system, so the final rename is atomic.
fn sibling(path: &Path, purpose: &str) -> Result<PathBuf, IoError> {
    let name = path.file_name().ok_or_else(|| {
        IoError::content(path, "is not the name of a file or folder that can be written")
    })?;
    let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{purpose}-{}-{unique}", std::process::id()));
    Ok(path.with_file_name(hidden))
}

/// The name under which an unfinished output of this process will appear, for messages: `out/frame.ply` of
/// `.out.partial-123-0/frame.ply`.
pub fn final_path(path: &Path) -> PathBuf {
    let process = format!("-{}-", std::process::id());
    let named = |part: &std::ffi::OsStr| -> Option<String> {
        let (name, purpose) = part.to_str()?.strip_prefix('.')?.rsplit_once('.')?;
        purpose.contains(&process).then(|| name.to_owned())
    };
    let part = |part: std::path::Component<'_>| {
        named(part.as_os_str()).map_or_else(|| part.as_os_str().to_owned(), Into::into)
    };
    path.components().map(part).collect()
}

/// Makes the folder that `path` goes into.
fn make_parent(path: &Path) -> Result<(), IoError> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => {
            let in_the_way = parent.ancestors().find(|ancestor| ancestor.exists());
            if let Some(file) = in_the_way.filter(|found| !found.is_dir()) {
                return Err(IoError::content(file, "is a file, expected a folder to write into"));
            }
            fs::create_dir_all(parent).map_err(IoError::write(parent))
        }
        _ => Ok(()),
    }
}

/// A file that appears under its name only when [`AtomicFile::commit`]ted; dropped uncommitted, nothing is left.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    temporary: PathBuf,
    existing: Existing,
    writer: Option<BufWriter<File>>,
}

impl AtomicFile {
    /// Opens a temporary file next to `path`, making the folder if it is missing.
    ///
    /// # Errors
    /// If `path` exists and may not be replaced, or the file cannot be made.
    pub fn create(path: impl AsRef<Path>, existing: Existing) -> Result<Self, IoError> {
        let path: PathBuf = path.as_ref().components().collect();
        let temporary = sibling(&path, "partial")?;
        refuse(&path, existing)?;
        make_parent(&path)?;
        let file = File::create_new(&temporary).map_err(IoError::write(&path))?;
        register(&temporary);
        Ok(Self {
            path,
            temporary,
            existing,
            writer: Some(BufWriter::with_capacity(1 << 20, file)),
        })
    }

    /// Puts the complete file under its name.
    ///
    /// # Errors
    /// If the last bytes cannot be written, or `path` has come into being since and may not be replaced.
    pub fn commit(mut self) -> Result<(), IoError> {
        if let Some(writer) = self.writer.take() {
            let file = writer
                .into_inner()
                .map_err(io::IntoInnerError::into_error)
                .map_err(IoError::write(&self.path))?;
            file.sync_all().map_err(IoError::write(&self.path))?;
        }
        refuse(&self.path, self.existing)?;
        fs::rename(&self.temporary, &self.path).map_err(IoError::write(&self.path))
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

impl Drop for AtomicFile {
    fn drop(&mut self) {
        self.writer = None;
        unregister(&self.temporary);
        // After a commit there is nothing under this name; otherwise a failed removal cannot be reported from here.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Refuses an existing file, and a folder in the place of a file.
fn refuse(path: &Path, existing: Existing) -> Result<(), IoError> {
    match (fs::symlink_metadata(path), existing) {
        (Ok(found), _) if found.is_dir() => {
            Err(IoError::content(path, "is a folder, expected the name of a file"))
        }
        (Err(_), _) | (Ok(_), Existing::Replace) => Ok(()),
        (Ok(_), Existing::Refuse) => Err(IoError::Exists { path: path.to_owned() }),
    }
}

/// A folder that appears under its name only when [`AtomicDir::commit`]ted; dropped uncommitted, nothing is left.
#[derive(Debug)]
pub struct AtomicDir {
    path: PathBuf,
    temporary: PathBuf,
    existing: Existing,
    is_ours: fn(&str) -> bool,
}

impl AtomicDir {
    /// Makes a temporary folder next to `path`. An existing empty folder is always replaced; one with content only with
    /// [`Existing::Replace`] and only if `is_ours` accepts the name of every entry, so that a mistyped path deletes nothing.
    ///
    /// # Errors
    /// If `path` exists and may not be replaced, or the folder cannot be made.
    pub fn create(
        path: impl AsRef<Path>,
        existing: Existing,
        is_ours: fn(&str) -> bool,
    ) -> Result<Self, IoError> {
        let path: PathBuf = path.as_ref().components().collect();
        let temporary = sibling(&path, "partial")?;
        let folder = Self { path, temporary, existing, is_ours };
        folder.refuse()?;
        make_parent(&folder.path)?;
        fs::create_dir(&folder.temporary).map_err(IoError::write(&folder.path))?;
        register(&folder.temporary);
        Ok(folder)
    }

    /// The temporary folder to write into.
    #[expect(clippy::misnamed_getters, reason = "the final path must not be written to")]
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    fn refuse(&self) -> Result<(), IoError> {
        let Ok(found) = fs::symlink_metadata(&self.path) else { return Ok(()) };
        if !found.is_dir() {
            return Err(IoError::content(&self.path, "is a file, expected the name of a folder"));
        }
        let entries = list_names(&self.path)?;
        if entries.is_empty() {
            return Ok(());
        }
        if self.existing == Existing::Refuse {
            return Err(IoError::Exists { path: self.path.clone() });
        }
        match entries.into_iter().find(|entry| !(self.is_ours)(entry)) {
            Some(entry) => Err(IoError::Foreign { path: self.path.clone(), entry }),
            None => Ok(()),
        }
    }

    /// Puts the complete folder under its name; what was there before is removed only after that worked.
    ///
    /// # Errors
    /// If renaming fails, or `path` has come into being since and may not be replaced.
    pub fn commit(self) -> Result<(), IoError> {
        self.refuse()?;
        let failed = |source| IoError::Write { path: self.path.clone(), source };
        if !self.path.exists() {
            return fs::rename(&self.temporary, &self.path).map_err(failed);
        }
        let old = sibling(&self.path, "replaced")?;
        fs::rename(&self.path, &old).map_err(failed)?;
        if let Err(error) = fs::rename(&self.temporary, &self.path) {
            // Best effort: the caller hears about the first failure either way.
            let _ = fs::rename(&old, &self.path);
            return Err(failed(error));
        }
        fs::remove_dir_all(&old).map_err(|source| IoError::Write { path: old.clone(), source })
    }
}

impl Drop for AtomicDir {
    fn drop(&mut self) {
        unregister(&self.temporary);
        // After a commit there is nothing under this name; otherwise a failed removal cannot be reported from here.
        let _ = fs::remove_dir_all(&self.temporary);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(path: &Path) -> Vec<String> {
        list_names(path).unwrap()
    }

    #[test]
    fn a_file_appears_only_when_complete() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep/out.bin");
        let mut file = AtomicFile::create(&path, Existing::Refuse).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert!(names(&dir.path().join("deep")).is_empty(), "nothing partial is left");
        let mut file = AtomicFile::create(&path, Existing::Refuse).unwrap();
        file.write_all(b"whole").unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole", "content");
        assert!(
            matches!(AtomicFile::create(&path, Existing::Refuse), Err(IoError::Exists { .. })),
            "not twice"
        );
        let mut file = AtomicFile::create(&path, Existing::Replace).unwrap();
        file.write_all(b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole", "old until committed");
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new", "replaced");
        assert_eq!(names(&dir.path().join("deep")), ["out.bin"], "no leftovers");
        let error = AtomicFile::create(path.join("under/a.bin"), Existing::Refuse).unwrap_err();
        assert!(error.to_string().contains("out.bin: is a file, expected a folder"), "{error}");
    }

    #[test]
    fn a_folder_appears_only_when_complete() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out");
        let ours: fn(&str) -> bool = |name| name.starts_with("frame_");
        let folder = AtomicDir::create(&path, Existing::Refuse, ours).unwrap();
        fs::write(folder.path().join("frame_0"), b"x").unwrap();
        drop(folder);
        assert!(names(dir.path()).is_empty(), "nothing partial is left");
        let folder = AtomicDir::create(&path, Existing::Refuse, ours).unwrap();
        fs::write(folder.path().join("frame_0"), b"x").unwrap();
        folder.commit().unwrap();
        assert_eq!(names(&path), ["frame_0"], "complete");
        assert!(
            matches!(AtomicDir::create(&path, Existing::Refuse, ours), Err(IoError::Exists { .. })),
            "not twice"
        );
        let folder = AtomicDir::create(&path, Existing::Replace, ours).unwrap();
        fs::write(folder.path().join("frame_1"), b"y").unwrap();
        folder.commit().unwrap();
        assert_eq!(names(&path), ["frame_1"], "replaced");
        assert_eq!(names(dir.path()), ["out"], "no leftovers");
        fs::write(path.join("thesis.tex"), b"years of work").unwrap();
        let error = AtomicDir::create(&path, Existing::Replace, ours).unwrap_err();
        assert!(
            matches!(&error, IoError::Foreign { entry, .. } if entry == "thesis.tex"),
            "{error}"
        );
        assert!(path.join("thesis.tex").exists(), "untouched");
    }

    #[test]
    fn messages_name_the_output_not_its_temporary() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.v2");
        let folder = AtomicDir::create(&path, Existing::Refuse, |_| true).unwrap();
        let inside = folder.path().join("rgb/00000.png");
        assert_ne!(inside, path.join("rgb/00000.png"), "written elsewhere");
        assert_eq!(final_path(&inside), path.join("rgb/00000.png"), "named as it will be");
        for plain in ["a/.hidden/b.c", "/x/y.z", "rel", "../up"] {
            assert_eq!(final_path(Path::new(plain)), Path::new(plain), "left alone");
        }
    }

    #[test]
    fn files_and_folders_are_not_confused() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("f"), b"").unwrap();
        assert!(
            AtomicDir::create(dir.path().join("f"), Existing::Replace, |_| true).is_err(),
            "a file in the way of a folder"
        );
        assert!(
            AtomicFile::create(dir.path(), Existing::Replace).is_err(),
            "a folder in the way of a file"
        );
        assert!(AtomicFile::create("/", Existing::Replace).is_err(), "no name");
    }
}
