//! The parts of a `.glb` or `.gltf`: its JSON, and the bytes of its buffers.

use super::GltfError;
use super::document::{Buffer, Document};
use crate::content::magic::GLB;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::borrow::Cow;

/// Types of GLB chunks.
pub(super) const CHUNK_JSON: u32 = 0x4E4F_534A;
pub(super) const CHUNK_BIN: u32 = 0x004E_4942;
const GLB_HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;
/// The JSON, and the binary chunk of a `.glb`, if any.
#[derive(Debug)]
pub(super) struct Parts<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
}

impl<'a> Parts<'a> {
    /// Splits a file into its parts.
    pub(super) fn of(bytes: &'a [u8]) -> Result<Self, GltfError> {
        if !bytes.starts_with(&GLB) {
            let json = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
            return Ok(Self { json, binary: None });
        }
        let word = |at: usize| {
            bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes)
        };
        let truncated = |part, expected: u128| GltfError::Truncated {
            part,
            expected,
            found: bytes.len() as u128,
        };
        let version = word(4).ok_or_else(|| truncated("the header", GLB_HEADER as u128))?;
        if version != 2 {
            return Err(GltfError::Version { found: version });
        }
        let (mut at, mut json, mut binary) = (GLB_HEADER, None, None);
        while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
            let start = at + CHUNK_HEADER;
            let end = start.saturating_add(length as usize);
            let body = bytes.get(start..end).ok_or_else(|| truncated("a chunk", end as u128))?;
            match kind {
                CHUNK_JSON if json.is_none() => json = Some(body),
                CHUNK_BIN if binary.is_none() => binary = Some(body),
                _ => {}
            }
            at = end;
        }
        let json = json.ok_or_else(|| GltfError::damaged("it has no JSON chunk"))?;
        Ok(Self { json, binary })
    }
}

/// The bytes of every buffer: from the binary chunk, from the URI itself, or from `external`.
pub(super) fn buffers<'a>(
    document: &Document,
    binary: Option<&'a [u8]>,
    external: &dyn Fn(&str) -> Result<Vec<u8>, String>,
) -> Result<Vec<Cow<'a, [u8]>>, GltfError> {
    let one = |(index, buffer): (usize, &Buffer)| {
        let bytes = match &buffer.uri {
            None if index == 0 => Cow::Borrowed(binary.unwrap_or_default()),
            None => Cow::Borrowed(&[][..]),
            Some(uri) => Cow::Owned(match data_of(uri) {
                Some(bytes) => bytes?,
                None => external(uri).map_err(GltfError::damaged)?,
            }),
        };
        if (bytes.len() as u64) < buffer.byte_length {
            return Err(GltfError::Truncated {
                part: "a buffer",
                expected: u128::from(buffer.byte_length),
                found: bytes.len() as u128,
            });
        }
        Ok(bytes)
    };
    document.buffers.iter().enumerate().map(one).collect()
}

/// The bytes of a `data:` URI; `None` for other URIs.
fn data_of(uri: &str) -> Option<Result<Vec<u8>, GltfError>> {
    let rest = uri.strip_prefix("data:")?;
    let decoded = match rest.split_once(',') {
        Some((kind, data)) if kind.ends_with(";base64") => {
            STANDARD.decode(data).map_err(|error| error.to_string())
        }
        _ => Err("expected base64".to_owned()),
    };
    Some(decoded.map_err(|what| GltfError::damaged(format!("a data URI: {what}"))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_are_decoded() {
        let bytes = data_of("data:application/octet-stream;base64,AAEC").unwrap().unwrap();
        assert_eq!(bytes, [0, 1, 2], "decoded");
        assert!(data_of("data:text/plain,abc").unwrap().is_err(), "not base64");
        assert!(data_of("scene.bin").is_none(), "a file");
    }
}
