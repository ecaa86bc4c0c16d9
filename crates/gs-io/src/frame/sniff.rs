//! What bytes are, from their content.

use super::FrameFormat;
use crate::foreign::Foreign;
use crate::ply::{Header, PlyError};
use crate::{compressed_ply, gltf, inflate, splat_file, spz};

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

/// Size of a frame, from its header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// What the file is.
    pub format: FrameFormat,
    /// `N`, as declared.
    pub num_splats: u64,
    /// SH degree 0–3.
    pub sh_degree: usize,
}

/// What the header of a frame declares. `start` is the first part of the file, at least its header (or all of it), `total` the size
/// of the file, bytes.
///
/// # Errors
/// If it is no frame, or its header breaks the rules. SOG and glTF frames are not looked into.
pub fn shape(start: &[u8], total: u64) -> Result<Shape, super::FrameError> {
    let unknown = || super::FrameError::Unknown { found: shown(start) };
    match container(start) {
        Container::Ply => {
            let header = Header::parse(start)?;
            match header.gaussians() {
                Ok(layout) => Ok(Shape {
                    format: FrameFormat::Ply {
                        encoding: header.encoding,
                        normals: layout.has_normals,
                    },
                    num_splats: layout.num_splats,
                    sh_degree: layout.sh_degree,
                }),
                Err(PlyError::Compressed) => compressed_ply::shape(&header),
                Err(other) => Err(other.into()),
            }
        }
        Container::Spz => spz::shape(start),
        Container::Splat => Ok(Shape {
            format: FrameFormat::Splat,
            num_splats: total / splat_file::ROW as u64,
            sh_degree: 0,
        }),
        Container::Zip | Container::Gltf | Container::Unknown => Err(unknown()),
    }
}
