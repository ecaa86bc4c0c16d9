//! Zip archives of stored (uncompressed) entries: PyTorch checkpoints in, PLY sequences out.
//!
//! Reading trusts the central directory only, since PyTorch leaves sizes and checksums of local headers at zero; every
//! offset is checked against the bytes there are. Writing puts real sizes and checksums into the local headers, so that
//! readers may stream.

use std::io::{self, Write};
use thiserror::Error;

/// A zip archive that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ZipError {
    /// No end-of-central-directory record.
    #[error(
        "not a complete zip archive: no directory at its end; the file is truncated or something else"
    )]
    NoDirectory,
    /// The directory contradicts itself or the file.
    #[error("damaged zip archive: {0}")]
    Damaged(String),
    /// An entry is compressed.
    #[error("zip entry `{0}` is compressed or encrypted, expected stored data")]
    NotStored(String),
}

/// An entry and where its data lie.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Entry<'a> {
    pub(crate) name: String,
    pub(crate) data: &'a [u8],
}

const END: u32 = 0x0605_4b50;
const END_64: u32 = 0x0606_4b50;
const LOCATOR_64: u32 = 0x0706_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const LOCAL: u32 = 0x0403_4b50;
/// Size of the end record without its comment.
const END_SIZE: usize = 22;
const CENTRAL_SIZE: usize = 46;
const LOCAL_SIZE: usize = 30;
/// Longest comment after the end record.
const MAX_COMMENT: usize = 65_535;

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    let raw = bytes.get(at..at.checked_add(2)?)?;
    Some(u16::from_le_bytes(raw.try_into().ok()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let raw = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(raw.try_into().ok()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    let raw = bytes.get(at..at.checked_add(8)?)?;
    Some(u64::from_le_bytes(raw.try_into().ok()?))
}

fn slice(bytes: &[u8], start: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(start).ok()?;
    let length = usize::try_from(length).ok()?;
    bytes.get(start..start.checked_add(length)?)
}

/// Position and size of the central directory.
fn directory(bytes: &[u8]) -> Option<(u64, u64)> {
    let last = bytes.len().checked_sub(END_SIZE)?;
    let first = last.saturating_sub(MAX_COMMENT);
    let end = (first..=last).rev().find(|&at| u32_at(bytes, at) == Some(END))?;
    let (size, offset) = (u32_at(bytes, end + 12)?, u32_at(bytes, end + 16)?);
    if size != u32::MAX && offset != u32::MAX && u16_at(bytes, end + 10)? != u16::MAX {
        return Some((offset.into(), size.into()));
    }
    let locator = end.checked_sub(20)?;
    if u32_at(bytes, locator)? != LOCATOR_64 {
        return Some((offset.into(), size.into()));
    }
    let end_64 = usize::try_from(u64_at(bytes, locator + 8)?).ok()?;
    if u32_at(bytes, end_64)? != END_64 {
        return None;
    }
    Some((u64_at(bytes, end_64.checked_add(48)?)?, u64_at(bytes, end_64.checked_add(40)?)?))
}

/// The entries of an archive, in directory order. Allocates in proportion to the directory.
pub(crate) fn entries(bytes: &[u8]) -> Result<Vec<Entry<'_>>, ZipError> {
    let (offset, size) = directory(bytes).ok_or(ZipError::NoDirectory)?;
    let mut rest = slice(bytes, offset, size)
        .ok_or_else(|| ZipError::Damaged("its directory lies outside the file".to_owned()))?;
    let mut entries = Vec::new();
    while rest.len() >= CENTRAL_SIZE {
        let damaged = || ZipError::Damaged(format!("directory entry {}", entries.len()));
        let (entry, length) = central_entry(bytes, rest).ok_or_else(damaged)??;
        entries.push(entry);
        rest = &rest[length..];
    }
    Ok(entries)
}

/// One entry of the central directory and its length there; `None` if it breaks the format.
fn central_entry<'a>(
    bytes: &'a [u8],
    header: &[u8],
) -> Option<Result<(Entry<'a>, usize), ZipError>> {
    if u32_at(header, 0)? != CENTRAL {
        return None;
    }
    let lengths = [28, 30, 32].map(|at| u16_at(header, at).map(usize::from));
    let [name_length, extra_length, comment_length] = lengths;
    let (name_length, extra_length) = (name_length?, extra_length?);
    let total = CENTRAL_SIZE + name_length + extra_length + comment_length?;
    let name = header.get(CENTRAL_SIZE..CENTRAL_SIZE + name_length)?;
    let name = String::from_utf8_lossy(name).into_owned();
    let extra =
        header.get(CENTRAL_SIZE + name_length..CENTRAL_SIZE + name_length + extra_length)?;
    header.get(..total)?;
    let encrypted = u16_at(header, 8)? & 1 == 1;
    if u16_at(header, 10)? != 0 || encrypted {
        return Some(Err(ZipError::NotStored(name)));
    }
    // Stored: both sizes are the same. Each field of all ones moves to the zip64 extra field, in this order.
    let mut wide = zip64_fields(extra);
    let mut widen = |value: u32| match value {
        u32::MAX => wide.next(),
        value => Some(u64::from(value)),
    };
    let uncompressed = widen(u32_at(header, 24)?)?;
    let compressed = widen(u32_at(header, 20)?)?;
    let local = usize::try_from(widen(u32_at(header, 42)?)?).ok()?;
    if uncompressed != compressed || u32_at(bytes, local)? != LOCAL {
        return None;
    }
    // The local header has its own name and padding; only their lengths are taken from it.
    let skipped = usize::from(u16_at(bytes, local + 26)?) + usize::from(u16_at(bytes, local + 28)?);
    let start = local.checked_add(LOCAL_SIZE + skipped)?;
    let data = slice(bytes, start as u64, compressed)?;
    Some(Ok((Entry { name, data }, total)))
}

/// The 64-bit values of the zip64 extra field, if there is one.
fn zip64_fields(extra: &[u8]) -> impl Iterator<Item = u64> + '_ {
    let mut at = 0;
    let mut field: &[u8] = &[];
    while let (Some(id), Some(length)) = (u16_at(extra, at), u16_at(extra, at + 2)) {
        let end = at + 4 + usize::from(length);
        if id == 1 {
            field = extra.get(at + 4..end).unwrap_or(&[]);
            break;
        }
        at = end;
    }
    field.as_chunks::<8>().0.iter().map(|raw| u64::from_le_bytes(*raw))
}

/// Writes stored entries one after the other to any stream. Never zip64: what does not fit is an error.
#[derive(Debug)]
pub(crate) struct StoredWriter<W: Write> {
    out: W,
    offset: u32,
    central: Vec<u8>,
    count: u16,
}

/// 1 January 1980, the first date of the format: archives of the same content are the same bytes.
const DATE: u16 = 0x21;

impl<W: Write> StoredWriter<W> {
    pub(crate) fn new(out: W) -> Self {
        Self { out, offset: 0, central: Vec::new(), count: 0 }
    }

    pub(crate) fn add(&mut self, name: &str, data: &[u8]) -> io::Result<()> {
        let crc = crc32fast::hash(data);
        let size = u32::try_from(data.len()).ok();
        let name_length = u16::try_from(name.len()).ok();
        // Room for the directory is kept free: the whole archive stays below 4 GiB.
        let end = size.and_then(|size| self.offset.checked_add(size)).and_then(|end| {
            let directory =
                self.central.len() + CENTRAL_SIZE + LOCAL_SIZE + 2 * name.len() + END_SIZE;
            end.checked_add(u32::try_from(directory).ok()?)
        });
        let (Some(size), Some(name_length), Some(_), true) =
            (size, name_length, end, self.count < u16::MAX - 1)
        else {
            return Err(io::Error::new(
                io::ErrorKind::FileTooLarge,
                "a zip archive that every player reads holds at most 4 GiB and 65534 files; write fewer frames, a lower SH degree, or a folder",
            ));
        };
        let mut common = Vec::new();
        for field in [10, 0, 0, 0, DATE] {
            common.extend_from_slice(&u16::to_le_bytes(field));
        }
        for field in [crc, size, size] {
            common.extend_from_slice(&field.to_le_bytes());
        }
        common.extend_from_slice(&name_length.to_le_bytes());
        common.extend_from_slice(&[0, 0]);
        self.central.extend_from_slice(&CENTRAL.to_le_bytes());
        self.central.extend_from_slice(&10_u16.to_le_bytes());
        self.central.extend_from_slice(&common);
        // Comment, disk, internal and external attributes.
        self.central.extend_from_slice(&[0; 10]);
        self.central.extend_from_slice(&self.offset.to_le_bytes());
        self.central.extend_from_slice(name.as_bytes());
        self.out.write_all(&LOCAL.to_le_bytes())?;
        self.out.write_all(&common)?;
        self.out.write_all(name.as_bytes())?;
        self.out.write_all(data)?;
        self.offset += 30 + u32::from(name_length) + size;
        self.count += 1;
        Ok(())
    }

    /// Writes the directory and gives the stream back.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let size = u32::try_from(self.central.len()).map_err(io::Error::other)?;
        self.out.write_all(&self.central)?;
        self.out.write_all(&END.to_le_bytes())?;
        self.out.write_all(&[0; 4])?;
        self.out.write_all(&self.count.to_le_bytes())?;
        self.out.write_all(&self.count.to_le_bytes())?;
        self.out.write_all(&size.to_le_bytes())?;
        self.out.write_all(&self.offset.to_le_bytes())?;
        self.out.write_all(&[0; 2])?;
        Ok(self.out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn archive() -> Vec<u8> {
        let mut writer = StoredWriter::new(Vec::new());
        writer.add("a/data.pkl", b"hello").unwrap();
        writer.add("a/data/0", &[7; 100]).unwrap();
        writer.finish().unwrap()
    }

    #[test]
    fn what_is_written_is_read() {
        let bytes = archive();
        let entries = entries(&bytes).unwrap();
        assert_eq!(entries.len(), 2, "both");
        assert_eq!(
            (entries[0].name.as_str(), entries[0].data),
            ("a/data.pkl", &b"hello"[..]),
            "first"
        );
        assert_eq!(entries[1].data, [7; 100], "second");
        // Local header: no data-descriptor flag, real size and checksum.
        assert_eq!(u16_at(&bytes, 6), Some(0), "flags");
        assert_eq!(u32_at(&bytes, 14), Some(crc32fast::hash(b"hello")), "checksum");
        assert_eq!(u32_at(&bytes, 18), Some(5), "size");
    }

    #[test]
    fn damaged_archives_are_refused() {
        let bytes = archive();
        assert_eq!(entries(&[]), Err(ZipError::NoDirectory), "empty");
        assert_eq!(entries(&bytes[..bytes.len() - 1]), Err(ZipError::NoDirectory), "cut");
        assert!(entries(&bytes[40..]).is_err(), "its start is missing");
        let mut compressed = bytes.clone();
        let directory = bytes.windows(4).position(|w| w == CENTRAL.to_le_bytes()).unwrap();
        compressed[directory + 10] = 8;
        assert!(matches!(entries(&compressed), Err(ZipError::NotStored(_))), "deflated");
    }
}
