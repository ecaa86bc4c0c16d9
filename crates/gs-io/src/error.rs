//! [`IoError`]: errors of reading and writing, with the file concerned.

use crate::cameras::CamerasError;
use crate::cfg_args::CfgError;
use crate::content::UnsupportedFormat;
use crate::frame::FrameError;
use crate::fs::final_path;
use crate::ply::PlyError;
use crate::pth::PthError;
use crate::repair::DamagedRows;
use crate::splat4d::Splat4dError;
use crate::splatv::SplatvError;
use gs_deform::FieldError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Error of reading or writing a file or folder. Every variant names it.
#[derive(Debug, Error)]
pub enum IoError {
    /// The operating system refused to read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: std::io::Error,
    },
    /// The operating system refused to write.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: std::io::Error,
    },
    /// The output exists and may not be replaced.
    #[error("{} already exists; choose another name or ask to overwrite it", path.display())]
    Exists {
        /// Path of the file or folder.
        path: PathBuf,
    },
    /// The folder to replace contains something that this program
    /// did not write, or that was changed since.
    #[error("{} is not replaced: this program wrote it, but `{entry}` in it {what}", path.display())]
    NotOurs {
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
    /// A PLY file is malformed or not a Gaussian scene.
    #[error("{}: {source}", path.display())]
    Ply {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: PlyError,
    },
    /// A still frame is malformed or of another kind.
    #[error("{}: {source}", path.display())]
    Frame {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: FrameError,
    },
    /// A PyTorch archive is malformed.
    #[error("{}: {source}", path.display())]
    Pth {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: PthError,
    },
    /// A `cfg_args` file is malformed.
    #[error("{}: {source}", path.display())]
    Cfg {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: CfgError,
    },
    /// A camera file is malformed.
    #[error("{}: {source}", path.display())]
    Cameras {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: CamerasError,
    },
    /// A `.splatv` file is malformed.
    #[error("{}: {source}", path.display())]
    Splatv {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: SplatvError,
    },
    /// A `.splat4d` file is malformed.
    #[error("{}: {source}", path.display())]
    Splat4d {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: Splat4dError,
    },
    /// The tensors of a file do not form a deformation field.
    #[error("{}: {source}", path.display())]
    Field {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the error.
        source: FieldError,
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
    pub(crate) fn content(path: &Path, what: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), what: what.into() }
    }

    pub(crate) fn ply(path: &Path) -> impl FnOnce(PlyError) -> Self {
        move |source| Self::Ply { path: path.to_owned(), source }
    }

    /// Keeps errors of PLY files as PLY errors.
    pub(crate) fn frame(path: &Path) -> impl FnOnce(FrameError) -> Self {
        move |source| match source {
            FrameError::Ply(source) => Self::Ply { path: path.to_owned(), source },
            source => Self::Frame { path: path.to_owned(), source },
        }
    }

    pub(crate) fn cameras(path: &Path) -> impl FnOnce(CamerasError) -> Self {
        move |source| Self::Cameras { path: path.to_owned(), source }
    }

    pub(crate) fn write(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Write { path: final_path(path), source }
    }
}
