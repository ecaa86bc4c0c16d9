//! Scenes made of numbered frames in a folder or zip archive, PLY or any other still format; and
//! writers of such folders and archives.

mod error;
mod hidden;
mod names;
mod read;
mod source;
mod write;

pub use error::SequenceError;
pub use read::{PlySequence, SequenceOptions};
pub use write::{FolderWriter, ZipWriter, write_compressed_folder, write_folder, write_zip};

pub(crate) use names::find_frames;
