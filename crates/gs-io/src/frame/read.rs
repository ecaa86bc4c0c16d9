//! Reading a frame of any format.

use super::folder::{PLACES, read_referenced, still_of};
use super::{Frame, FrameError, FrameFormat, Shape};
use crate::content::splat_rows::ROW;
use crate::content::{Container, container, shown};
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::ply::{self, Header, PlyError, PlySplats};
use crate::{
    compressed_ply, freetime, gltf, gsplat, model_folder, sog, spacetime, splat_file, spz,
};
use std::path::Path;

/// Reads a frame of any format.
///
/// # Errors
/// Describes the error, or the kind of the bytes if they are not a frame. Memory is bounded by a
/// multiple of their number; compressed data that would grow far beyond it are rejected.
pub fn read(bytes: &[u8]) -> Result<Frame, FrameError> {
    match container(bytes) {
        Container::Ply => {
            if compressed_ply::is_compressed(bytes) {
                return Ok(compressed_ply::read(bytes)?);
            }
            of_ply(ply::read(bytes)?)
        }
        Container::Spz => Ok(spz::read(bytes)?),
        Container::Zip if gsplat::contents(bytes).is_some() => Ok(Frame {
            splats: gsplat::read(bytes)?,
            format: FrameFormat::Gsplat,
            precision: None,
            axes: None,
            notes: Vec::new(),
            comments: Vec::new(),
        }),
        Container::Zip => Ok(sog::read(bytes)?),
        Container::Splat => Ok(splat_file::read(bytes)?),
        Container::Gltf => Ok(gltf::read(bytes, &|uri| {
            Err(format!("its data are in a separate file, `{uri}`; use the path of the .gltf"))
        })?),
        Container::Unknown => Err(FrameError::Unknown { found: shown(bytes) }),
    }
}

/// The frame of a PLY.
fn of_ply(read: PlySplats) -> Result<Frame, FrameError> {
    if let Some(what) = moving(&read.extra_columns) {
        return Err(FrameError::Moving { what });
    }
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

/// The method of a dynamic scene with these extra PLY columns,
/// whose other columns are not a frame of it.
fn moving(extra_columns: &[String]) -> Option<&'static str> {
    if spacetime::has_columns(extra_columns) {
        return Some("Spacetime Gaussians");
    }
    freetime::has_columns(extra_columns).then_some("FreeTimeGS")
}

/// Reads a frame from a file, or from the output folder of an editor: the
/// `save/last.ply` of a GaussianEditor or DGE run, the `point_cloud.ply` of a
/// frozen frame, the `meta.json` of an unbundled SOG.
///
/// # Errors
/// If nothing there can be read as a frame; the error names the file.
pub fn read_file(path: &Path) -> Result<Frame, IoError> {
    if path.is_dir() {
        return read_dir(path);
    }
    if let Some(read) = ply::read_in_blocks(path)? {
        return of_ply(read).map_err(IoError::format(path));
    }
    let bytes = read_bytes(path)?;
    if container(&bytes) == Container::Gltf {
        let folder = path.parent().unwrap_or(Path::new(""));
        let read = gltf::read(&bytes, &|uri| read_referenced(folder, uri));
        return read.map_err(FrameError::from).map_err(IoError::format(path));
    }
    read(&bytes).map_err(IoError::format(path))
}

/// Shape declared in the header of a frame. `start` is the first part of the file, at least its
/// header (or the whole file), `total` the size of the file, bytes.
///
/// # Errors
/// If it is not a frame, or its header is malformed. SOG and glTF frames are not examined.
pub fn shape(start: &[u8], total: u64) -> Result<Shape, FrameError> {
    let unknown = || FrameError::Unknown { found: shown(start) };
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
                Err(PlyError::Compressed) => Ok(compressed_ply::shape(&header)?),
                Err(other) => Err(other.into()),
            }
        }
        Container::Spz => Ok(spz::shape(start)?),
        Container::Splat => {
            Ok(Shape { format: FrameFormat::Splat, num_splats: total / ROW as u64, sh_degree: 0 })
        }
        Container::Zip | Container::Gltf | Container::Unknown => Err(unknown()),
    }
}

/// Reads the frame in a folder.
fn read_dir(folder: &Path) -> Result<Frame, IoError> {
    let Some(path) = still_of(folder) else {
        return Err(IoError::content(
            folder,
            if model_folder::looks_like_model(folder) {
                "is a dynamic model, whose point_cloud.ply is canonical and not a frame; write a \
                frame with `c4d freeze` and edit that"
                    .to_owned()
            } else {
                format!(
                    "folder without an edited frame; expected one of {} in it",
                    PLACES.join(", ")
                )
            },
        ));
    };
    if path.ends_with("meta.json") {
        let meta = read_bytes(&path)?;
        // Planes are named by the file, and must be in the same folder.
        let plane = |name: &str| {
            let plain = Path::new(name).file_name().is_some_and(|file| file == name);
            if !plain {
                return Err(format!("its plane `{name}` is not a plain file name"));
            }
            read_bytes(&folder.join(name)).map_err(|error| format!("its plane {error}"))
        };
        let read = sog::read_planes(&meta, &plane);
        return read.map_err(FrameError::from).map_err(IoError::format(&path));
    }
    read(&read_bytes(&path)?).map_err(IoError::format(&path))
}
