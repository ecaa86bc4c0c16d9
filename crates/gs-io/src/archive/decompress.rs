//! Decompression with bounded output.

use std::io::Read;

/// Size up to which any stream may decompress, bytes; the compression ratio of small files is
/// unbounded.
pub(crate) const FREE: u64 = 16 << 20;
/// Largest compression ratio beyond that size. Splat data compress to a twentieth at best, even if
/// all splats have the same colour and size.
const MAX_RATIO: u64 = 64;

/// Largest size to which `compressed` bytes may decompress.
pub(crate) fn limit(compressed: usize) -> u64 {
    FREE.max(MAX_RATIO.saturating_mul(compressed as u64))
}

/// Decompresses a gzip stream to at most [`limit`] bytes; the error is a message.
pub(crate) fn gunzip(bytes: &[u8]) -> Result<Vec<u8>, String> {
    read_within(flate2::read::GzDecoder::new(bytes), limit(bytes.len()))
}

/// The first `count` bytes of a gzip stream; fewer if it ends early or is damaged.
pub(crate) fn gunzip_start(bytes: &[u8], count: u64) -> Vec<u8> {
    let mut start = Vec::new();
    // Bytes decompressed before an error are kept.
    let _broken = flate2::read::GzDecoder::new(bytes).take(count).read_to_end(&mut start);
    start
}

/// Decompresses a zstd frame to exactly `size` bytes, at most [`limit`].
pub(crate) fn unzstd(bytes: &[u8], size: u64) -> Result<Vec<u8>, String> {
    unzstd_within(bytes, size, limit(bytes.len()))
}

/// Decompresses a zstd frame to exactly `size` bytes, at most `limit`.
pub(crate) fn unzstd_within(bytes: &[u8], size: u64, limit: u64) -> Result<Vec<u8>, String> {
    let size = usize::try_from(size)
        .ok()
        .filter(|&size| size as u64 <= limit)
        .ok_or_else(|| too_large(limit))?;
    let mut out = vec![0; size];
    let written = zstd::bulk::Decompressor::new()
        .and_then(|mut decompressor| decompressor.decompress_to_buffer(bytes, &mut out))
        .map_err(|error| error.to_string())?;
    if written == size { Ok(out) } else { Err(format!("{written} bytes, expected {size}")) }
}

/// All bytes of `reader`, if there are at most `limit`.
pub(crate) fn read_within(reader: impl Read, limit: u64) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    reader
        .take(limit.saturating_add(1))
        .read_to_end(&mut out)
        .map_err(|error| error.to_string())?;
    if out.len() as u64 > limit { Err(too_large(limit)) } else { Ok(out) }
}

fn too_large(limit: u64) -> String {
    format!("decompresses to more than {limit} bytes, more than splat data of this size can")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn decompression_bombs_are_refused() {
        let zeros = vec![0; usize::try_from(FREE).unwrap() + (1 << 20)];
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(&zeros).unwrap();
        let gzip = gzip.finish().unwrap();
        assert!(gunzip(&gzip).unwrap_err().contains("decompresses to more"), "gzip");
        assert_eq!(gunzip_start(&gzip, 16), [0; 16], "its start");
        let packed = zstd::bulk::compress(&zeros, 1).unwrap();
        assert!(unzstd(&packed, zeros.len() as u64).unwrap_err().contains("more than"), "zstd");
        let small = zstd::bulk::compress(&zeros[..5000], 1).unwrap();
        assert_eq!(unzstd(&small, 5000).unwrap().len(), 5000, "whole");
        assert!(unzstd(&small, 4999).is_err(), "longer than declared");
        assert!(unzstd(&small, 5001).unwrap_err().contains("expected 5001"), "shorter");
    }
}
