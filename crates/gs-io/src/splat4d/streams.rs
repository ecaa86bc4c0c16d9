//! Reading of streams: heads, and symbols in byte planes.

use super::Splat4dError;
use super::value::Attribute;
use crate::archive::decompress;
use std::ops::Range;

/// Bytes of a stream's head: `u8 attribute, u8 kind, u8 width, u32 symbols, u32 compressed bytes`.
pub(super) const HEAD: usize = 11;

/// Inverse of [`super::symbols::zigzag`].
pub(super) fn unzigzag(symbol: u32) -> i32 {
    (symbol >> 1).cast_signed() ^ -(symbol & 1).cast_signed()
}

/// Head of a stream.
#[derive(Debug, Clone, Copy)]
pub(super) struct Head {
    pub(super) attribute: u8,
    pub(super) kind: u8,
    width: u8,
    count: u32,
    /// Compressed bytes.
    pub(super) packed: usize,
}

impl Head {
    pub(super) fn parse(bytes: &[u8; HEAD]) -> Self {
        let u32_at = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|k| bytes[at + k]));
        Self {
            attribute: bytes[0],
            kind: bytes[1],
            width: bytes[2],
            count: u32_at(3),
            packed: u32_at(7) as usize,
        }
    }

    /// Decompresses the symbols, whose number must be `expected`; `room` is the remaining
    /// decompressed size allowed for all streams, bytes.
    pub(super) fn unpack(
        self,
        payload: &[u8],
        expected: usize,
        room: &mut u64,
    ) -> Result<Symbols, Splat4dError> {
        let Self { attribute, kind, width, count, .. } = self;
        let damaged = |what: String| {
            Splat4dError::Stream(format!(
                "the stream of attribute {attribute}, kind {kind}, {what}"
            ))
        };
        if ![1, 2, 4].contains(&width) {
            return Err(damaged(format!("has symbols of {width} bytes, expected 1, 2 or 4")));
        }
        if count as usize != expected {
            return Err(damaged(format!("has {count} symbols, expected {expected}")));
        }
        let size = u64::from(count) * u64::from(width);
        let planes = decompress::unzstd_within(payload, size, *room)
            .map_err(|what| damaged(format!("cannot be decompressed: {what}")))?;
        *room -= size;
        Ok(Symbols { planes, count: expected })
    }
}

/// Unsigned symbols: all low bytes, then all next bytes, and so on.
#[derive(Debug, Default)]
pub(super) struct Symbols {
    planes: Vec<u8>,
    count: usize,
}

impl Symbols {
    /// Calls `visit` with the index within `range`, from 0, and the value of every symbol.
    pub(super) fn each(&self, range: Range<usize>, mut visit: impl FnMut(usize, u32)) {
        let first = range.start;
        if self.planes.len() == self.count {
            for (k, &byte) in self.planes[range].iter().enumerate() {
                visit(k, u32::from(byte));
            }
            return;
        }
        for at in range {
            // Highest plane first.
            let planes = self.planes[at..].iter().step_by(self.count);
            let symbol = planes.rev().fold(0, |symbol, &byte| symbol << 8 | u32::from(byte));
            visit(at - first, symbol);
        }
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }
}

/// The attribute with number `id`.
pub(super) fn attribute(id: u8) -> Result<Attribute, Splat4dError> {
    Attribute::ALL.get(usize::from(id)).copied().ok_or_else(|| {
        Splat4dError::Stream(format!("a stream is of attribute {id}, expected 0 to 4"))
    })
}

#[cfg(test)]
mod tests {
    use super::super::symbols::{self, Kind, zigzag};
    use super::*;

    #[test]
    fn streams_round_trip_for_any_width() {
        for symbols in [vec![0, 255, 7], vec![1, 256, 65_535], vec![u32::MAX, 0, 1 << 30]] {
            let mut written: symbols::Symbols = symbols.iter().copied().collect();
            let mut bytes = Vec::new();
            written.take(2, Kind::Key).unwrap().append_to(&mut bytes);
            let (head, payload) = bytes.split_first_chunk().unwrap();
            let head = Head::parse(head);
            assert_eq!((head.attribute, head.kind, head.packed), (2, 0, payload.len()), "head");
            let mut room = 100;
            let read = head.unpack(payload, 3, &mut room).unwrap();
            let mut all = Vec::new();
            read.each(0..read.len(), |_, symbol| all.push(symbol));
            assert_eq!(all, symbols, "values");
            let mut last = Vec::new();
            read.each(1..3, |at, symbol| last.push((at, symbol)));
            assert_eq!(last, [(0, symbols[1]), (1, symbols[2])], "a part");
            assert!(head.unpack(payload, 4, &mut room).is_err(), "another number");
            assert!(head.unpack(payload, 3, &mut 2).is_err(), "no room");
        }
    }

    #[test]
    fn signs_round_trip() {
        for value in [0, -1, 1, 77, -12_345, i32::MAX, i32::MIN] {
            assert_eq!(unzigzag(zigzag(value)), value, "{value}");
        }
    }
}
