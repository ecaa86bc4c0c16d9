//! Entries of zip archives as slices of the file, for PyTorch
//! checkpoints, whose tensors are not copied.

use std::io::Cursor;
use thiserror::Error;
use zip::{CompressionMethod, ZipArchive};

/// A zip archive that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ZipError {
    /// The archive has no usable directory at its end.
    #[error("not a complete zip archive ({0}): the file is truncated or not a zip archive")]
    NoDirectory(String),
    /// An entry of the directory is inconsistent with the file.
    #[error("damaged zip archive: {0}")]
    Damaged(String),
    /// An entry is compressed.
    #[error("zip entry `{0}` is compressed or encrypted, expected stored data")]
    NotStored(String),
}

/// Name and data of an entry.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Entry<'a> {
    pub(crate) name: String,
    pub(crate) data: &'a [u8],
}

/// The entries of an archive, in directory order.
pub(crate) fn entries(bytes: &[u8]) -> Result<Vec<Entry<'_>>, ZipError> {
    let mut archive = ZipArchive::new(Cursor::new(bytes))
        .map_err(|error| ZipError::NoDirectory(error.to_string()))?;
    (0..archive.len())
        .map(|index| {
            let damaged = |what: String| ZipError::Damaged(format!("entry {index}: {what}"));
            let entry = archive.by_index_raw(index).map_err(|error| damaged(error.to_string()))?;
            let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
            if entry.encrypted() || entry.compression() != CompressionMethod::Stored {
                return Err(ZipError::NotStored(name));
            }
            let start = entry.data_start().and_then(|start| usize::try_from(start).ok());
            let size = usize::try_from(entry.compressed_size()).ok();
            let range =
                start.zip(size).and_then(|(start, size)| Some(start..start.checked_add(size)?));
            let data = range
                .and_then(|range| bytes.get(range))
                .ok_or_else(|| damaged(format!("the data of `{name}` lie outside the file")))?;
            Ok(Entry { name, data })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive::StoredWriter;

    fn archive() -> Vec<u8> {
        let mut writer = StoredWriter::new(Vec::new());
        writer.add("a/data.pkl", b"hello").unwrap();
        writer.add("a/data/0", &[7; 100]).unwrap();
        writer.finish().unwrap()
    }

    #[test]
    fn written_entries_are_read_back() {
        let bytes = archive();
        let entries = entries(&bytes).unwrap();
        assert_eq!(entries.len(), 2, "both");
        assert_eq!(
            (entries[0].name.as_str(), entries[0].data),
            ("a/data.pkl", &b"hello"[..]),
            "first"
        );
        assert_eq!(entries[1].data, [7; 100], "second");
    }

    #[test]
    fn damaged_archives_are_refused() {
        let bytes = archive();
        for cut in [&[][..], &bytes[..bytes.len() - 1]] {
            assert!(matches!(entries(cut), Err(ZipError::NoDirectory(_))), "{} bytes", cut.len());
        }
        assert!(entries(&bytes[40..]).is_err(), "its start is missing");
        let mut compressed = bytes.clone();
        let directory = bytes.windows(4).position(|w| w == *b"PK\x01\x02").unwrap();
        compressed[directory + 10] = 8;
        assert!(matches!(entries(&compressed), Err(ZipError::NotStored(_))), "deflated");
    }
}
