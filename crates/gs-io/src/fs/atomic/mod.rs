//! Outputs that are complete or absent, and never replace files that this program did not write.
//!
//! An output is written under a hidden name in the same folder and renamed when it is complete. For
//! `out/clip.mp4` these names are
//!
//! | name | content |
//! |---|---|
//! | `out/.clip.mp4.c4d-lock` | empty; locked ([`std::fs::File::try_lock`]) while in use |
//! | `out/.clip.mp4.c4d-partial` | the output so far |
//! | `out/.clip.mp4.c4d-replaced` | the old folder, between two renames |
//!
//! The operating system releases the lock when its process ends, so a process
//! that acquires it can remove the other two as leftovers of a killed process.
//! A second process on the same output is rejected.
//!
//! For the rules of replacement see [`AtomicDir`] and [`AtomicFile`]. Links,
//! devices, FIFOs and sockets are never replaced.

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
