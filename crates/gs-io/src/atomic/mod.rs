//! Outputs that are complete or absent, and never replace what this program did not write.
//!
//! An output is written under a hidden name beside its own and renamed when it is complete. Of `out/clip.mp4` these names are
//!
//! | name | content |
//! |---|---|
//! | `out/.clip.mp4.c4d-lock` | nothing; locked (see [`std::fs::File::try_lock`]) while a process writes the output |
//! | `out/.clip.mp4.c4d-partial` | the output so far |
//! | `out/.clip.mp4.c4d-replaced` | the folder that is being replaced, for the moment between two renames |
//!
//! The lock ends with its process, however that ends, so whoever holds it knows that the other two are left over from a process that is
//! no more, and removes them. A second process on the same output is refused.
//!
//! What may be replaced: of folders, see [`AtomicDir`]; of files, see [`AtomicFile`]. Links, devices, FIFOs and sockets never are.

mod file;
mod folder;
mod kind;
mod record;
mod reservation;
mod update;

pub use file::AtomicFile;
pub use folder::AtomicDir;
pub use reservation::{final_path, remove_unfinished};
pub use update::FolderUpdate;

pub(crate) use record::is_bookkeeping;

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

/// Name of what is neither file nor folder.
pub(crate) fn special_name(kind: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "a FIFO";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_block_device() || kind.is_char_device() {
            return "a device";
        }
    }
    if kind.is_symlink() { "a link" } else { "neither a file nor a folder" }
}

/// Refuses a link, device, FIFO or socket in the place of an output.
fn refuse_special(path: &Path, kind: FileType) -> Result<(), crate::IoError> {
    if kind.is_file() || kind.is_dir() {
        return Ok(());
    }
    let taken = |what: String, next: String| {
        Err(crate::IoError::Taken { path: path.to_owned(), what, next })
    };
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
