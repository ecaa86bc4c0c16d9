//! Archives and compressed streams, read within bounds.

pub(crate) mod decompress;
mod stored_entries;
mod stored_writer;
mod zip_file;

pub use stored_entries::ZipError;

pub(crate) use stored_entries::entries;
pub(crate) use stored_writer::StoredWriter;
pub(crate) use zip_file::Archive;
