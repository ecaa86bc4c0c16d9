//! Zip archives provided by users: stored or deflated entries,
//! read one at a time with bounded size.

use crate::archive::decompress;
use std::io::{Read, Seek};
use zip::ZipArchive;

/// An open archive.
#[derive(Debug)]
pub(crate) struct Archive<R> {
    zip: ZipArchive<R>,
    names: Vec<String>,
}

impl<R: Read + Seek> Archive<R> {
    /// Reads the directory; the error is a message.
    pub(crate) fn open(reader: R) -> Result<Self, String> {
        let zip = ZipArchive::new(reader).map_err(|error| error.to_string())?;
        let names = zip
            .file_names()
            .map(|name| name.map(std::borrow::Cow::into_owned).map_err(|error| error.to_string()))
            .collect::<Result<_, _>>()?;
        Ok(Self { zip, names })
    }

    /// Names of the entries.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// A whole entry, limited to `limit` bytes and to the largest
    /// size plausible for its compressed size.
    pub(crate) fn read(&mut self, name: &str, limit: u64) -> Result<Vec<u8>, String> {
        let failed = |error: &dyn std::fmt::Display| format!("{name}: {error}");
        let entry = self.zip.by_name(name).map_err(|error| failed(&error))?;
        let packed = usize::try_from(entry.compressed_size()).unwrap_or(usize::MAX);
        let limit = limit.min(decompress::limit(packed));
        decompress::read_within(entry, limit).map_err(|error| failed(&error))
    }

    /// The first `count` bytes of an entry and its declared size.
    pub(crate) fn start(&mut self, name: &str, count: u64) -> Result<(Vec<u8>, u64), String> {
        let failed = |error: &dyn std::fmt::Display| format!("{name}: {error}");
        let entry = self.zip.by_name(name).map_err(|error| failed(&error))?;
        let size = entry.size();
        let mut start = Vec::new();
        entry.take(count).read_to_end(&mut start).map_err(|error| failed(&error))?;
        Ok((start, size))
    }
}
