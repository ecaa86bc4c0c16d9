//! Zip archives of stored (uncompressed) entries, written to a stream.
//!
//! Sizes and checksums are in the local headers, so that archives can be read as a stream. Equal
//! contents give identical bytes.

use std::io::{self, Write};

const END: u32 = 0x0605_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const LOCAL: u32 = 0x0403_4b50;
/// Bytes of the end record without its comment, of a directory entry and of a local header without
/// their names.
const END_SIZE: usize = 22;
const CENTRAL_SIZE: usize = 46;
const LOCAL_SIZE: usize = 30;

/// Writes stored entries sequentially to any stream. Does not use
/// zip64: too large archives are an error.
#[derive(Debug)]
pub(crate) struct StoredWriter<W: Write> {
    out: W,
    offset: u32,
    central: Vec<u8>,
    count: u16,
}

/// 1 January 1980, the first date of the format; a constant, so
/// that equal contents give identical bytes.
const DATE: u16 = 0x21;

impl<W: Write> StoredWriter<W> {
    pub(crate) fn new(out: W) -> Self {
        Self { out, offset: 0, central: Vec::new(), count: 0 }
    }

    pub(crate) fn add(&mut self, name: &str, data: &[u8]) -> io::Result<()> {
        let crc = crc32fast::hash(data);
        let size = u32::try_from(data.len()).ok();
        let name_length = u16::try_from(name.len()).ok();
        // Reserves room for the directory, so that the whole archive stays below 4 GiB.
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
                "a zip archive without zip64 extensions is limited to 4 GiB and 65534 files; \
                write fewer frames, a lower SH degree, or a folder",
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

    /// Writes the directory and returns the stream.
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

    #[test]
    fn local_headers_are_complete() {
        let mut writer = StoredWriter::new(Vec::new());
        writer.add("a", b"hello").unwrap();
        let bytes = writer.finish().unwrap();
        assert_eq!(bytes[6..8], [0, 0], "flags: no data descriptor");
        assert_eq!(bytes[14..18], crc32fast::hash(b"hello").to_le_bytes(), "checksum");
        assert_eq!(bytes[18..22], 5_u32.to_le_bytes(), "size");
    }
}
