//! What bytes are, from their content.

use crate::foreign::Foreign;
use crate::{gltf, inflate, splat_file, spz};

/// What the first bytes announce.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Container {
    /// `ply`, plain or compressed.
    Ply,
    /// `NGSP`, plain or in gzip.
    Spz,
    /// A zip archive: SOG, or something else.
    Zip,
    /// A binary glTF, or JSON that looks like one.
    Gltf,
    /// No mark, but rows that make sense as `.splat`.
    Splat,
    /// None of them.
    Unknown,
}

pub(crate) const ZIP_MARK: [u8; 4] = *b"PK\x03\x04";
/// Bytes of a JSON file looked at.
const JSON_START: usize = 16 << 10;
pub(crate) const GZIP_MARK: [u8; 2] = [0x1f, 0x8b];

/// Looks at the first bytes, and at some rows where there is no mark.
pub(crate) fn container(bytes: &[u8]) -> Container {
    if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") || bytes.starts_with(b"ply ") {
        Container::Ply
    } else if bytes.starts_with(&ZIP_MARK) {
        Container::Zip
    } else if bytes.starts_with(&spz::MARK)
        || (bytes.starts_with(&GZIP_MARK) && inflate::gunzip_start(bytes, 4) == spz::MARK)
    {
        Container::Spz
    } else if bytes.starts_with(&gltf::GLB_MARK)
        || gltf::looks_like_json(&bytes[..bytes.len().min(JSON_START)])
    {
        Container::Gltf
    } else if splat_file::looks_like(bytes) {
        Container::Splat
    } else {
        Container::Unknown
    }
}

/// What bytes of no frame are, for a message: a format by name, or what they start with.
pub(crate) fn shown(bytes: &[u8]) -> String {
    if let Some(foreign) = Foreign::of(bytes) {
        return foreign.name.to_owned();
    }
    let found: String = String::from_utf8_lossy(&bytes[..bytes.len().min(12)])
        .chars()
        .map(|c| if c.is_control() { '·' } else { c })
        .collect();
    if found.is_empty() {
        "an empty file".to_owned()
    } else {
        format!("a file that starts with `{found}`")
    }
}
