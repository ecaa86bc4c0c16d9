//! [`IoError`]: errors of reading and writing, with the file concerned.

use crate::content::UnsupportedFormat;
use crate::fs::final_path;
use crate::repair::DamagedRows;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Error of reading or writing a file or folder. Every variant names it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// The operating system returned an error on reading.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: std::io::Error,
    },
    /// The operating system returned an error on writing.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: std::io::Error,
    },
    /// The output exists and may not be replaced.
    #[error("{} already exists; choose a different name or allow overwriting", path.display())]
    Exists {
        /// Path of the file or folder.
        path: PathBuf,
    },
    /// The folder to replace contains something that this program
    /// did not write, or that was changed since.
    #[error("{} is not replaced: this program wrote it, but `{entry}` in it {what}", path.display())]
    UnrecordedEntry {
        /// Path of the folder.
        path: PathBuf,
        /// First such entry, relative to it.
        entry: String,
        /// Predicate about the entry, to complete a sentence.
        what: &'static str,
    },
    /// The path of the output is taken by something that is never replaced.
    #[error("{} {what}", path.display())]
    Taken {
        /// Path of the output.
        path: PathBuf,
        /// Predicate about it, to complete a sentence.
        what: String,
        /// Next step for the user.
        next: String,
    },
    /// Another process is writing the same output.
    #[error("{} is being written by another process", path.display())]
    Busy {
        /// Path of the output.
        path: PathBuf,
    },
    /// The file is a stand-in: a pointer to the actual file, or a web page.
    #[error("{}: is {}, not the file itself", path.display(), found.name)]
    StandIn {
        /// Path of the file.
        path: PathBuf,
        /// The stand-in found, with the next step.
        found: UnsupportedFormat,
    },
    /// The bytes of a file are damaged or of a different kind.
    #[error("{}: {source}", path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Error of the format, such as [`PlyError`](crate::ply::PlyError); [`IoError::cause`]
        /// returns it with its type.
        source: Box<dyn Error + Send + Sync>,
    },
    /// Damaged rows where none are allowed.
    #[error("{}: {source}", path.display())]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// Number and kind of damaged rows.
        source: DamagedRows,
    },
    /// A folder or archive lacks required content.
    #[error("{}: {what}", path.display())]
    Content {
        /// Path of the folder or file.
        path: PathBuf,
        /// Missing or inconsistent content, and the next step.
        what: String,
    },
    /// A clip is not written because the format does not suit it; can be overridden.
    #[error("cannot write {}: {what}", path.display())]
    Unfit {
        /// Path of the output.
        path: PathBuf,
        /// Cause of the error.
        what: String,
    },
    /// The scene that was being written could not be evaluated.
    #[error("cannot write {}: {source}", path.display())]
    Scene {
        /// Path of the output.
        path: PathBuf,
        /// Error of the scene.
        source: gs_core::SceneError,
    },
}

impl IoError {
    /// The first error of type `E` among the causes, for example
    /// `error.cause::<PlyError>()` or `error.cause::<FieldError>()`.
    pub fn cause<E: Error + 'static>(&self) -> Option<&E> {
        let mut next = self.source();
        while let Some(error) = next {
            if let Some(found) = error.downcast_ref() {
                return Some(found);
            }
            next = error.source();
        }
        None
    }

    pub(crate) fn content(path: &Path, what: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), what: what.into() }
    }

    /// Adds the path of the file to the error of its format.
    pub(crate) fn format<E>(path: &Path) -> impl FnOnce(E) -> Self
    where
        E: Error + Send + Sync + 'static,
    {
        move |source| Self::Format { path: path.to_owned(), source: Box::new(source) }
    }

    pub(crate) fn damaged(path: &Path) -> impl FnOnce(DamagedRows) -> Self {
        move |source| Self::Damaged { path: path.to_owned(), source }
    }

    pub(crate) fn write(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Write { path: final_path(path), source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn causes_are_found_by_type_at_any_depth() {
        #[derive(Debug, thiserror::Error)]
        #[error("outer: {0}")]
        struct Outer(#[source] io::Error);
        let cause = Outer(io::Error::other("inner"));
        let error = IoError::format(Path::new("a.ply"))(cause);
        assert_eq!(error.to_string(), "a.ply: outer: inner", "path first");
        assert!(error.cause::<Outer>().is_some(), "the error of the format");
        assert!(error.cause::<io::Error>().is_some(), "its cause");
        assert!(error.cause::<std::fmt::Error>().is_none(), "a different type");
        assert!(IoError::content(Path::new("a"), "is empty").cause::<Outer>().is_none(), "none");
    }
}
