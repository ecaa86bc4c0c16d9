//! [`Source`]: location of a sequence's frames.

use super::SequenceError;
use super::find_frames;
use crate::archive::Archive;
use crate::archive::decompress;
use crate::content::is_read_whole;
use crate::error::IoError;
use crate::frame::{self, Shape};
use crate::fs::list_names;
use crate::fs::{read_bytes, refuse_stand_in};
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Numbers of bytes that contain the header of nearly every frame, and of every frame.
const STARTS: [u64; 2] = [16 << 10, 1 << 20];

/// Entries other than the frames.
#[derive(Debug, Default)]
pub(super) struct OtherEntries {
    /// Names of the other entries.
    pub(super) ignored: Vec<String>,
    /// Note on the series used, if there are several.
    pub(super) series: Option<String>,
}

/// Frames in order of time.
#[derive(Debug)]
pub(super) enum Source {
    /// One file per frame.
    Folder(Vec<PathBuf>),
    /// Entries of a zip archive.
    Zip {
        path: [PathBuf; 1],
        names: Vec<String>,
        archive: Mutex<Archive<BufReader<File>>>,
        /// Largest size of a frame, bytes.
        limit: u64,
    },
}

impl Source {
    /// The frames of a folder, and its other entries.
    pub(super) fn folder(dir: &Path) -> Result<(Self, OtherEntries), IoError> {
        let found = find_frames(&list_names(dir)?).map_err(IoError::format(dir))?;
        let paths = found.frames.iter().map(|name| dir.join(name)).collect();
        Ok((Self::Folder(paths), OtherEntries { ignored: found.ignored, series: found.series }))
    }

    /// The frames of an archive, and its other entries.
    pub(super) fn zip(path: &Path) -> Result<(Self, OtherEntries), IoError> {
        let failed = |source| IoError::Read { path: path.to_owned(), source };
        let mut file = crate::fs::open_file(path).map_err(failed)?;
        let size = file.metadata().map_err(failed)?.len();
        let mut start = Vec::new();
        (&mut file).take(STARTS[0]).read_to_end(&mut start).map_err(failed)?;
        refuse_stand_in(path, &start)?;
        file.rewind().map_err(failed)?;
        let limit = decompress::limit(usize::try_from(size).unwrap_or(usize::MAX));
        let archive = Archive::open(BufReader::new(file)).map_err(|what| {
            let what = format!("is not a readable zip archive: {what}");
            IoError::format(path)(SequenceError::Archive(what))
        })?;
        let found = find_frames(archive.names()).map_err(IoError::format(path))?;
        let mut ignored = found.ignored;
        ignored.retain(|name| !name.ends_with('/'));
        let archive = Mutex::new(archive);
        let others = OtherEntries { ignored, series: found.series };
        Ok((Self::Zip { path: [path.to_owned()], names: found.frames, archive, limit }, others))
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::Folder(paths) => paths.len(),
            Self::Zip { names, .. } => names.len(),
        }
    }

    pub(super) fn paths(&self) -> &[PathBuf] {
        match self {
            Self::Folder(paths) => paths,
            Self::Zip { path, .. } => path,
        }
    }

    /// Name of a frame, for messages.
    pub(super) fn name(&self, index: usize) -> String {
        match self {
            Self::Folder(paths) => {
                paths[index].file_name().unwrap_or_default().to_string_lossy().into_owned()
            }
            Self::Zip { names, .. } => names[index].clone(),
        }
    }

    /// Path of a frame, for messages; for an entry it includes the archive's path.
    pub(super) fn label(&self, index: usize) -> PathBuf {
        match self {
            Self::Folder(paths) => paths[index].clone(),
            Self::Zip { path, names, .. } => path[0].join(&names[index]),
        }
    }

    /// Size of a frame, from its header.
    pub(super) fn shape(&self, index: usize) -> Result<Shape, IoError> {
        let label = self.label(index);
        let mut result = None;
        for count in STARTS {
            let (start, total) = self.start(index, count)?;
            refuse_stand_in(&label, &start)?;
            if is_read_whole(&start) {
                let read = frame::read(&self.read(index)?).map_err(IoError::format(&label))?;
                return Ok(Shape {
                    format: read.format,
                    num_splats: read.splats.len() as u64,
                    sh_degree: read.splats.sh_degree,
                });
            }
            let shape = frame::shape(&start, total);
            let whole = (start.len() as u64) < count;
            if shape.is_ok() || whole {
                return shape.map_err(IoError::format(&label));
            }
            result = Some(shape);
        }
        result.map_or_else(
            || Err(IoError::format(&label)(SequenceError::Empty)),
            |shape| shape.map_err(IoError::format(&label)),
        )
    }

    fn start(&self, index: usize, count: u64) -> Result<(Vec<u8>, u64), IoError> {
        match self {
            Self::Folder(paths) => {
                let failed = |source| IoError::Read { path: paths[index].clone(), source };
                let file = crate::fs::open_file(&paths[index]).map_err(failed)?;
                let total = file.metadata().map_err(failed)?.len();
                let mut start = Vec::new();
                file.take(count).read_to_end(&mut start).map_err(failed)?;
                Ok((start, total))
            }
            Self::Zip { path, names, archive, .. } => {
                let mut archive = archive.lock().unwrap_or_else(PoisonError::into_inner);
                archive
                    .start(&names[index], count)
                    .map_err(SequenceError::Archive)
                    .map_err(IoError::format(&path[0]))
            }
        }
    }

    /// The bytes of a frame.
    pub(super) fn read(&self, index: usize) -> Result<Vec<u8>, IoError> {
        match self {
            Self::Folder(paths) => read_bytes(&paths[index]),
            Self::Zip { path, names, archive, limit } => {
                let mut archive = archive.lock().unwrap_or_else(PoisonError::into_inner);
                archive
                    .read(&names[index], *limit)
                    .map_err(SequenceError::Archive)
                    .map_err(IoError::format(&path[0]))
            }
        }
    }
}
