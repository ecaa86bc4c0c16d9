//! [`Existing`]: what may be in the place of an output.

use super::special_name;
use crate::error::IoError;
use std::fs::FileType;
use std::path::Path;

/// What to do when the output exists.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Existing {
    /// Fail before anything is written.
    #[default]
    Refuse,
    /// Replace it when the new one is complete, if this program wrote it.
    Replace,
}

/// Refuses a link, device, FIFO or socket in the place of an output.
pub(super) fn refuse_special(path: &Path, kind: FileType) -> Result<(), IoError> {
    if kind.is_file() || kind.is_dir() {
        return Ok(());
    }
    let taken =
        |what: String, next: String| Err(IoError::Taken { path: path.to_owned(), what, next });
    if !kind.is_symlink() {
        let what = format!("is {}, which is never written to", special_name(kind));
        return taken(what, "Choose another name for the output.".to_owned());
    }
    match (path.canonicalize(), std::fs::read_link(path)) {
        (Ok(target), _) => taken(
            format!("is a link to {}, and links are never replaced", target.display()),
            format!("Name {} itself, or choose another name.", target.display()),
        ),
        (Err(_), Ok(target)) => taken(
            format!("is a link to {}, which does not exist", target.display()),
            "Remove the link, or choose another name.".to_owned(),
        ),
        (Err(error), Err(_)) => taken(
            format!("is a link that cannot be read ({error})"),
            "Remove the link, or choose another name.".to_owned(),
        ),
    }
}
