//! Outputs that are complete or absent, and never replace what this program did not write.
//!
//! An output is written under a hidden name beside its own and renamed when it is complete. Of
//! `out/clip.mp4` these names are
//!
//! | name | content |
//! |---|---|
//! | `out/.clip.mp4.c4d-lock` | empty; locked ([`std::fs::File::try_lock`]) while in use |
//! | `out/.clip.mp4.c4d-partial` | the output so far |
//! | `out/.clip.mp4.c4d-replaced` | the old folder, between two renames |
//!
//! The lock ends with its process, however that ends, so whoever holds it knows that the other two
//! are left over from a process that is no more, and removes them. A second process on the same
//! output is refused.
//!
//! What may be replaced: of folders, see [`AtomicDir`]; of files, see [`AtomicFile`]. Links,
//! devices, FIFOs and sockets never are.

mod existing;
mod file;
mod folder;
mod record;
mod reservation;
mod special;
mod unfinished;
mod update;

pub use existing::Existing;
pub use file::AtomicFile;
pub use folder::AtomicDir;
pub use unfinished::{final_path, remove_unfinished};
pub use update::FolderUpdate;

pub(crate) use record::is_bookkeeping;
pub(crate) use special::special_name;
