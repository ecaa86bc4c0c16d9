//! [`Existing`]: treatment of an existing output.

use super::special_name;
use crate::error::IoError;
use std::fs::FileType;
use std::path::Path;

/// Treatment of an existing output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Existing {
    /// Fail before anything is written.
    #[default]
    Refuse,
    /// Replace it once the new one is complete, if this program wrote it.
    Replace,
}

/// Fails for a link, device, FIFO or socket at the path of an output.
pub(super) fn refuse_special(path: &Path, kind: FileType) -> Result<(), IoError> {
    if kind.is_file() || kind.is_dir() {
        return Ok(());
    }
    let taken =
        |what: String, next: String| Err(IoError::Taken { path: path.to_owned(), what, next });
    if !kind.is_symlink() {
        let what = format!("is {}, which c4d does not write to", special_name(kind));
        return taken(what, "Choose a different name for the output.".to_owned());
    }
    match (path.canonicalize(), std::fs::read_link(path)) {
        (Ok(target), _) => taken(
            format!("is a link to {}, and links are not replaced", target.display()),
            format!("Use {} itself, or choose a different name.", target.display()),
        ),
        (Err(_), Ok(target)) => taken(
            format!("is a link to {}, which does not exist", target.display()),
            "Remove the link, or choose a different name.".to_owned(),
        ),
        (Err(error), Err(_)) => taken(
            format!("is a link that cannot be read ({error})"),
            "Remove the link, or choose a different name.".to_owned(),
        ),
    }
}
