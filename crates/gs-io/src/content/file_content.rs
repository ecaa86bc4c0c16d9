//! [`FileContent`]: kinds of files, which determine whether one may be replaced.

use super::container::{Container, container};
use super::magic::{FOURDGS, GLB, NPY, SPLAT4D, SPLATV};
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Kinds of file that this program writes under a name that the user chose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileContent {
    Ply,
    Splat,
    Spz,
    Zip,
    Splatv,
    Splat4d,
    Fourdgs,
    Usda,
    Html,
    Glb,
    Gltf,
    Json,
    Png,
    Webp,
    Gif,
    Mp4,
    Exr,
    Npy,
    Flo,
    /// An empty file.
    Empty,
    /// Any other content.
    Unknown,
}

/// Magic bytes of a kind, and their offset.
const MAGIC: [(usize, &[u8], FileContent); 12] = [
    (0, &SPLATV, FileContent::Splatv),
    (0, &SPLAT4D, FileContent::Splat4d),
    (0, &FOURDGS, FileContent::Fourdgs),
    (0, b"#usda", FileContent::Usda),
    (0, &GLB, FileContent::Glb),
    (0, b"\x89PNG", FileContent::Png),
    (8, b"WEBP", FileContent::Webp),
    (0, b"GIF8", FileContent::Gif),
    (4, b"ftyp", FileContent::Mp4),
    (0, b"\x76\x2f\x31\x01", FileContent::Exr),
    (0, &NPY, FileContent::Npy),
    (0, b"PIEH", FileContent::Flo),
];

/// Number of bytes examined; `.splat` has no magic, so some of its rows are needed.
const START: u64 = 16 << 10;

impl FileContent {
    /// Kind of content of a file.
    pub(crate) fn of(path: &Path) -> io::Result<Self> {
        let mut start = Vec::new();
        File::open(path)?.take(START).read_to_end(&mut start)?;
        if start.is_empty() {
            return Ok(Self::Empty);
        }
        let magic = MAGIC
            .iter()
            .find(|(at, magic, _)| start.get(*at..).is_some_and(|bytes| bytes.starts_with(magic)));
        if let Some((_, _, kind)) = magic {
            return Ok(*kind);
        }
        let text: String =
            start.iter().take(64).map(|&b| char::from(b.to_ascii_lowercase())).collect();
        let text = text.trim_start();
        if text.starts_with("<!doctype html") || text.starts_with("<html") {
            return Ok(Self::Html);
        }
        if text.starts_with(['{', '[']) {
            let is_gltf = start.windows(7).any(|bytes| bytes == b"\"asset\"");
            return Ok(if is_gltf { Self::Gltf } else { Self::Json });
        }
        Ok(match container(&start) {
            Container::Ply => Self::Ply,
            Container::Spz => Self::Spz,
            Container::Zip if holds_frames(&start) => Self::Zip,
            Container::Splat => Self::Splat,
            Container::Gltf => Self::Gltf,
            Container::Zip | Container::Unknown => Self::Unknown,
        })
    }

    /// Kind of content expected for a file name.
    pub(crate) fn of_name(path: &Path) -> Self {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        match ending.as_str() {
            "ply" => Self::Ply,
            "splat" => Self::Splat,
            "spz" => Self::Spz,
            "zip" | "sog" => Self::Zip,
            "splatv" => Self::Splatv,
            "splat4d" => Self::Splat4d,
            "4dgs" => Self::Fourdgs,
            "usda" => Self::Usda,
            "html" | "htm" => Self::Html,
            "glb" => Self::Glb,
            "gltf" => Self::Gltf,
            "json" => Self::Json,
            "png" => Self::Png,
            "webp" => Self::Webp,
            "gif" => Self::Gif,
            "mp4" => Self::Mp4,
            "exr" => Self::Exr,
            "npy" => Self::Npy,
            "flo" => Self::Flo,
            _ => Self::Unknown,
        }
    }
}

/// Whether the first entry of a zip archive is a frame, or a part of one.
fn holds_frames(start: &[u8]) -> bool {
    let Some(&[low, high]) = start.get(26..28) else { return false };
    let length = usize::from(u16::from_le_bytes([low, high]));
    let name = start.get(30..30 + length).unwrap_or_default();
    [&b".ply"[..], b".webp", b"meta.json"].iter().any(|ending| name.ends_with(ending))
}

impl fmt::Display for FileContent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ply => "a PLY",
            Self::Splat => "a .splat",
            Self::Spz => "an SPZ",
            Self::Zip => "a zip archive of frames",
            Self::Splatv => "a .splatv clip",
            Self::Splat4d => "a .splat4d clip",
            Self::Fourdgs => "a .4dgs clip",
            Self::Usda => "an OpenUSD text",
            Self::Html => "an HTML page",
            Self::Glb => "a binary glTF",
            Self::Gltf => "a glTF",
            Self::Json => "JSON",
            Self::Png => "a PNG image",
            Self::Webp => "a WebP image",
            Self::Gif => "a GIF image",
            Self::Mp4 => "an MP4 video",
            Self::Exr => "an OpenEXR image",
            Self::Npy => "a NumPy array",
            Self::Flo => "a flow file",
            Self::Empty => "nothing",
            Self::Unknown => "something else",
        })
    }
}
