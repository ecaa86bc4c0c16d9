//! Detects the container format of bytes by content.

use super::magic::{BYTE_ORDER_MARK, GLB, GZIP, SPZ, ZIP};
use super::splat_rows;
use super::unsupported::UnsupportedFormat;
use crate::archive::decompress;

/// Container format indicated by the first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Container {
    /// `ply`, plain or compressed.
    Ply,
    /// `NGSP`, plain or in gzip.
    Spz,
    /// A zip archive, such as SOG.
    Zip,
    /// A binary glTF, or JSON that looks like one.
    Gltf,
    /// No magic, but plausible rows of `.splat`.
    Splat,
    /// None of them.
    Unknown,
}

/// Number of bytes of a JSON file that are examined.
const JSON_START: usize = 16 << 10;

/// Member names; a glTF has one of them near its start, in any order.
const MEMBERS: [&[u8]; 5] =
    [b"\"asset\"", b"\"accessors\"", b"\"bufferViews\"", b"\"meshes\"", b"\"extensionsUsed\""];

/// Detects the format by its magic, or by some rows if there is none.
pub(crate) fn container(bytes: &[u8]) -> Container {
    let text = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    if [&b"ply\n"[..], b"ply\r", b"ply "].iter().any(|line| text.starts_with(line)) {
        Container::Ply
    } else if bytes.starts_with(&ZIP) {
        Container::Zip
    } else if bytes.starts_with(&SPZ)
        || (bytes.starts_with(&GZIP) && decompress::gunzip_start(bytes, 4) == SPZ)
    {
        Container::Spz
    } else if bytes.starts_with(&GLB) || looks_like_gltf(&bytes[..bytes.len().min(JSON_START)]) {
        Container::Gltf
    } else if splat_rows::looks_like(bytes) {
        Container::Splat
    } else {
        Container::Unknown
    }
}

/// Whether text is a JSON object with members of glTF.
fn looks_like_gltf(start: &[u8]) -> bool {
    let text = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start).trim_ascii_start();
    text.starts_with(b"{")
        && MEMBERS.iter().any(|name| text.windows(name.len()).any(|found| found == *name))
}

/// Description of bytes that are not a frame, for messages: the
/// name of a format, or the first bytes.
pub(crate) fn shown(bytes: &[u8]) -> String {
    if let Some(format) = UnsupportedFormat::of(bytes) {
        return format.name.to_owned();
    }
    let is_text = bytes.iter().all(|byte| *byte >= b' ' || byte.is_ascii_whitespace());
    let (what, length) = if is_text { ("a text", 40) } else { ("a file", 12) };
    let found: String = String::from_utf8_lossy(&bytes[..bytes.len().min(length)])
        .trim()
        .chars()
        .map(|c| if c.is_control() { '·' } else { c })
        .collect();
    if bytes.is_empty() {
        "an empty file".to_owned()
    } else {
        format!("{what} that starts with `{found}`")
    }
}

/// Whether the size of a frame is known only after reading the whole file, as
/// for SOG and glTF, whose headers do not state it.
pub(crate) fn is_read_whole(start: &[u8]) -> bool {
    matches!(container(start), Container::Zip | Container::Gltf)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gltf_is_distinguished_from_other_json() {
        assert!(
            looks_like_gltf(b"\xef\xbb\xbf\n {\"asset\": {}}"),
            "byte order mark and space \
                                 before it"
        );
        assert!(!looks_like_gltf(b"{\"frames\": [], \"camera_angle_x\": 1}"), "cameras");
        assert!(!looks_like_gltf(b"\"asset\""), "no object");
    }
}
