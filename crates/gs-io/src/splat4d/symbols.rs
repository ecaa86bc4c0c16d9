//! Streams of unsigned symbols: byte planes, compressed.

use std::io;

/// zstd level: higher ones save a few percent and take several times as long. Levels up to 19 use
/// windows of at most 8 MiB, which browsers can decode.
const LEVEL: i32 = 12;

/// Small integers of either sign as small unsigned ones: 0, −1, 1, −2 … become 0, 1, 2, 3 ….
pub(super) fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)).cast_unsigned()
}

/// Unsigned symbols in byte planes; planes are added when a symbol needs them.
#[derive(Debug, Default)]
pub(super) struct Symbols {
    planes: [Vec<u8>; 4],
    /// Bytes per symbol: 1, 2 or 4; 0 before the first.
    width: usize,
}

impl Symbols {
    pub(super) fn push(&mut self, symbol: u32) {
        let needed = match symbol {
            0..=0xff => 1,
            0x100..=0xffff => 2,
            _ => 4,
        };
        if needed > self.width {
            let length = self.len();
            for plane in &mut self.planes[self.width..needed] {
                plane.resize(length, 0);
            }
            self.width = needed;
        }
        for (plane, byte) in self.planes[..self.width].iter_mut().zip(symbol.to_le_bytes()) {
            plane.push(byte);
        }
    }

    pub(super) fn len(&self) -> usize {
        self.planes[0].len()
    }

    /// Compresses all symbols and clears them.
    ///
    /// # Errors
    /// If there are more symbols than the format can count.
    pub(super) fn take(&mut self, attribute: u8, kind: Kind) -> io::Result<Stream> {
        let too_many =
            || io::Error::other("more than 4 billion values in one stream of a .splat4d");
        let count = u32::try_from(self.len()).map_err(|_overflow| too_many())?;
        let payload = zstd::bulk::compress(&self.planes[..self.width].concat(), LEVEL)?;
        let packed = u32::try_from(payload.len()).map_err(|_overflow| too_many())?;
        #[expect(clippy::cast_possible_truncation, reason = "1, 2 or 4")]
        let width = self.width.max(1) as u8;
        self.planes.iter_mut().for_each(Vec::clear);
        self.width = 0;
        let mut head = [0; Stream::HEAD];
        head[..3].copy_from_slice(&[attribute, kind as u8, width]);
        head[3..7].copy_from_slice(&count.to_le_bytes());
        head[7..].copy_from_slice(&packed.to_le_bytes());
        Ok(Stream { head, payload })
    }
}

impl FromIterator<u32> for Symbols {
    fn from_iter<I: IntoIterator<Item = u32>>(symbols: I) -> Self {
        let mut all = Self::default();
        symbols.into_iter().for_each(|symbol| all.push(symbol));
        all
    }
}

/// Kind of a stream, numbered as in the file.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    /// First frame of a group.
    Key = 0,
    /// Differences of the other frames.
    Delta = 1,
    /// Valid for the whole clip.
    Static = 2,
}

/// A compressed stream.
#[derive(Debug)]
pub(super) struct Stream {
    /// `u8 attribute, u8 kind, u8 width, u32 symbols, u32 compressed bytes`.
    pub(super) head: [u8; Self::HEAD],
    pub(super) payload: Vec<u8>,
}

impl Stream {
    const HEAD: usize = 11;

    /// Appends head and payload.
    pub(super) fn append_to(&self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.head);
        bytes.extend_from_slice(&self.payload);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zigzag_is_small_for_small_values() {
        let values = [0, -1, 1, -2, 2, i32::MAX, i32::MIN];
        assert_eq!(values.map(zigzag), [0, 1, 2, 3, 4, u32::MAX - 1, u32::MAX], "as documented");
    }

    #[test]
    fn planes_widen_when_needed() {
        let mut symbols: Symbols = [1, 0x1_00, 0x1_0000].into_iter().collect();
        assert_eq!(symbols.width, 4, "width of the widest symbol");
        assert_eq!(symbols.planes[0], [1, 0, 0], "low bytes");
        assert_eq!(symbols.planes[1], [0, 1, 0], "second bytes");
        assert_eq!(symbols.planes[2], [0, 0, 1], "third bytes");
        let stream = symbols.take(3, Kind::Delta).unwrap();
        assert_eq!(stream.head[..7], [3, 1, 4, 3, 0, 0, 0], "head");
        assert_eq!(zstd::bulk::decompress(&stream.payload, 64).unwrap().len(), 12, "3 × 4 bytes");
        assert_eq!(symbols.len(), 0, "taken");
    }
}
