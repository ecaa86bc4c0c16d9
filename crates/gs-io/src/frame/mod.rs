//! One still frame of Gaussians, in whatever format an editor left it.
//!
//! [`read`] goes by content, never by name: 3DGS PLY, PlayCanvas compressed PLY, `.splat`, `.spz` versions 2 to 4, `.sog`, glTF. All give
//! stored (pre-activation) parameters. Formats that round also say how coarsely ([`Frame::precision`]), so that what only the format
//! changed can be told from what a person changed.

mod error;
mod folder;
mod sniff;

pub use error::FrameError;
pub use sniff::{Shape, shape};

use crate::axes::{self, Axes, AxesReading};
use crate::error::{IoError, read_bytes};
use crate::ply::{self, Encoding};
use crate::repair::{self, Damage, DamagedRows, RepairReport};
use crate::{compressed_ply, gltf, sog, splat_file, spz};
use gs_core::{Precision, Splats};
use std::fmt::{self, Display};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Format of a still frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameFormat {
    /// 3DGS PLY.
    Ply {
        /// How the data are written.
        encoding: Encoding,
        /// Whether the file has (unused) normals.
        normals: bool,
    },
    /// PlayCanvas compressed PLY.
    CompressedPly,
    /// `.splat`, 32 bytes a row.
    Splat,
    /// `.spz` of this version.
    Spz(u32),
    /// `.sog`, version 2.
    Sog,
    /// `.glb` or `.gltf` with `KHR_gaussian_splatting`.
    Gltf,
}

impl Display for FrameFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ply { .. } => f.write_str("3D Gaussian PLY"),
            Self::CompressedPly => f.write_str("PlayCanvas compressed PLY"),
            Self::Splat => f.write_str(".splat"),
            Self::Spz(version) => write!(f, "SPZ version {version}"),
            Self::Sog => f.write_str("SOG"),
            Self::Gltf => f.write_str("glTF"),
        }
    }
}

/// A still frame as read.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The Gaussians, stored parameters, rows in file order.
    pub splats: Splats,
    /// What the file is.
    pub format: FrameFormat,
    /// How coarsely it stores values; `None` where it keeps every bit.
    pub precision: Option<Arc<Precision>>,
    /// In which axes the file was read, for formats that come in several; the splats are in those of PLYs.
    pub axes: Option<AxesReading>,
    /// What was changed or left out on reading, counted, one sentence each.
    pub notes: Vec<String>,
    /// Comments of the file.
    pub comments: Vec<String>,
}

impl Frame {
    /// The frame as if its file had these axes, whatever it says. Frames of formats that have one order of axes stay as they are.
    #[must_use]
    pub fn in_axes(mut self, axes: Axes) -> Self {
        if let Some(reading) = &mut self.axes {
            // Back to how the file has it, then on.
            axes::convert(&mut self.splats, Axes::PLY, reading.axes);
            axes::convert(&mut self.splats, axes, Axes::PLY);
            *reading = AxesReading { axes, stated: true, ..*reading };
        }
        self
    }

    /// Drops, keeps or refuses damaged rows; see [`repair::sanitize`].
    ///
    /// # Errors
    /// As [`repair::sanitize`].
    pub fn sanitize(self, damage: Damage) -> Result<(Self, RepairReport), DamagedRows> {
        let sanitized = repair::sanitize(self.splats, damage)?;
        let precision = match &sanitized.kept {
            Some(kept) => self.precision.map(|precision| Arc::new(precision.select(kept))),
            None => self.precision,
        };
        Ok((Self { splats: sanitized.splats, precision, ..self }, sanitized.report))
    }
}

/// Reads a frame of any format.
///
/// # Errors
/// Says what is wrong with the bytes or what they are instead. Memory is bounded by a multiple of their number: compressed data
/// that would grow beyond all measure are refused.
pub fn read(bytes: &[u8]) -> Result<Frame, FrameError> {
    match sniff::container(bytes) {
        sniff::Container::Ply => {
            if compressed_ply::is_compressed(bytes) {
                return compressed_ply::read(bytes);
            }
            let read = ply::read(bytes)?;
            let mut notes = read.notes;
            if !read.extra_columns.is_empty() {
                notes.push(format!("columns not used: {}", read.extra_columns.join(", ")));
            }
            Ok(Frame {
                splats: read.splats,
                format: FrameFormat::Ply { encoding: read.encoding, normals: read.has_normals },
                precision: None,
                axes: None,
                notes,
                comments: read.comments,
            })
        }
        sniff::Container::Spz => spz::read(bytes),
        sniff::Container::Zip => sog::read(bytes),
        sniff::Container::Splat => splat_file::read(bytes),
        sniff::Container::Gltf => gltf::read(bytes, &|uri| {
            Err(format!("its data lie in another file, `{uri}`; give the .gltf by its path"))
        }),
        sniff::Container::Unknown => Err(FrameError::Unknown { found: sniff::shown(bytes) }),
    }
}

/// Reads a frame from a file, or from the folder an editor left: the `save/last.ply` of a GaussianEditor or DGE run, the
/// `point_cloud.ply` of a frozen frame, the `meta.json` of an unbundled SOG.
///
/// # Errors
/// If nothing there can be read as a frame; the file is named.
pub fn read_file(path: impl AsRef<Path>) -> Result<Frame, IoError> {
    let path = path.as_ref();
    if path.is_dir() {
        return folder::read_dir(path);
    }
    let bytes = read_bytes(path)?;
    if sniff::container(&bytes) == sniff::Container::Gltf {
        let folder = path.parent().unwrap_or(Path::new(""));
        return gltf::read(&bytes, &|uri| folder::beside(folder, uri))
            .map_err(IoError::frame(path));
    }
    read(&bytes).map_err(IoError::frame(path))
}

/// The file that [`read_file`] reads: the path itself, or the one in the folder.
pub fn file_of(path: impl AsRef<Path>) -> PathBuf {
    let path = path.as_ref();
    let inside = if path.is_dir() { folder::still_of(path) } else { None };
    inside.unwrap_or_else(|| path.to_owned())
}

pub(crate) use folder::still_of as still_of_folder;
pub(crate) use sniff::{Container, container, shown};
