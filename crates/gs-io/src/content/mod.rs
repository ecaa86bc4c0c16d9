//! Detection of formats by content, below the readers, without running them.

mod container;
mod file_content;
pub(crate) mod magic;
pub(crate) mod splat_rows;
mod unsupported;

pub use unsupported::UnsupportedFormat;

pub(crate) use container::{Container, container, is_read_whole, shown};
pub(crate) use file_content::FileContent;
pub(crate) use unsupported::{MANIFEST, MANIFEST_ENDING, NUMPY_ARCHIVE, torch_archive};
