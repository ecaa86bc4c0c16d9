//! File-system primitives: inputs that are files, outputs that are complete or absent.

mod atomic;
mod input;
pub(crate) mod text;

pub use atomic::{AtomicDir, AtomicFile, Existing, FolderUpdate, final_path, remove_unfinished};
pub use input::{open_file, read_file};

pub(crate) use atomic::is_bookkeeping;
pub(crate) use input::{check_room, list_names, read_bytes, refuse_stand_in};
