//! Writing sequences, with one frame in memory at a time.
//!
//! The layout that every known player accepts: `frame_00000.ply` and so on from 0, without other
//! files; in a zip archive, stored entries at the root with sizes and checksums in their local
//! headers, below the limits of zip64.

use crate::archive::StoredWriter;
use crate::clip::each_frame;
use crate::compressed_ply;
use crate::error::IoError;
use crate::format_losses::FormatLosses;
use crate::fs::{AtomicDir, AtomicFile, Existing};
use crate::ply::{self, WriteOptions};
use gs_core::{DynamicScene, Splats};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Name of frame `index`.
fn frame_name(index: usize) -> String {
    format!("frame_{index:05}.ply")
}

/// Name of frame `index` of a compressed sequence, as expected by SuperSplat.
fn compressed_name(index: usize) -> String {
    format!("frame_{index:05}.compressed.ply")
}

fn too_short(path: &Path, frames: usize) -> Result<(), IoError> {
    if frames >= 2 {
        return Ok(());
    }
    Err(IoError::content(
        path,
        format!("{frames} frames are not a sequence; write at least 2, or a single PLY"),
    ))
}

/// Writes a folder of frames; it appears under its name only when finished.
#[derive(Debug)]
pub struct FolderWriter {
    dir: AtomicDir,
    path: PathBuf,
    frames: usize,
}

impl FolderWriter {
    /// Begins a folder.
    ///
    /// # Errors
    /// If `dir` has content that must not be replaced (only folders of frames are), or cannot be
    /// created.
    pub fn create(dir: &Path, existing: Existing) -> Result<Self, IoError> {
        let path = dir.to_owned();
        Ok(Self { dir: AtomicDir::create_bare(&path, existing)?, path, frames: 0 })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn push(&mut self, splats: &Splats, options: &WriteOptions) -> Result<(), IoError> {
        self.add(&frame_name(self.frames), |file| ply::write(splats, options, file))
    }

    /// Adds a frame as compressed PLY and returns the losses. For rows to persist, every frame
    /// needs the same [`compressed_ply::WriteOptions::order`].
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn push_compressed(
        &mut self,
        splats: &Splats,
        options: &compressed_ply::WriteOptions,
    ) -> Result<FormatLosses, IoError> {
        self.add(&compressed_name(self.frames), |file| compressed_ply::write(splats, options, file))
    }

    fn add<T>(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut BufWriter<File>) -> io::Result<T>,
    ) -> Result<T, IoError> {
        let failed = |source| IoError::Write { path: self.path.clone(), source };
        let file = File::create_new(self.dir.path().join(name)).map_err(failed)?;
        let mut file = BufWriter::with_capacity(1 << 20, file);
        let written = write(&mut file).map_err(failed)?;
        file.flush().map_err(failed)?;
        self.frames += 1;
        Ok(written)
    }

    /// Completes the folder.
    ///
    /// # Errors
    /// If there are fewer than two frames, or the folder cannot be put in place.
    pub fn finish(self) -> Result<(), IoError> {
        too_short(&self.path, self.frames)?;
        self.dir.commit()
    }
}

/// Writes a zip archive of frames; it appears under its name only when finished.
#[derive(Debug)]
pub struct ZipWriter {
    zip: StoredWriter<AtomicFile>,
    path: PathBuf,
    frames: usize,
    buffer: Vec<u8>,
}

impl ZipWriter {
    /// Begins an archive.
    ///
    /// # Errors
    /// If `path` exists and may not be replaced, or cannot be made.
    pub fn create(path: &Path, existing: Existing) -> Result<Self, IoError> {
        let path = path.to_owned();
        let zip = StoredWriter::new(AtomicFile::create(&path, existing)?);
        Ok(Self { zip, path, frames: 0, buffer: Vec::new() })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// If it cannot be written or the archive would grow beyond 4 GiB or 65 534 frames.
    pub fn push(&mut self, splats: &Splats, options: &WriteOptions) -> Result<(), IoError> {
        self.buffer.clear();
        ply::write(splats, options, &mut self.buffer).map_err(IoError::write(&self.path))?;
        self.zip.add(&frame_name(self.frames), &self.buffer).map_err(IoError::write(&self.path))?;
        self.frames += 1;
        Ok(())
    }

    /// Completes the archive.
    ///
    /// # Errors
    /// If there are fewer than two frames, or the archive cannot be put in place.
    pub fn finish(self) -> Result<(), IoError> {
        too_short(&self.path, self.frames)?;
        self.zip.finish().map_err(IoError::write(&self.path))?.commit()
    }
}

/// Writes the scene at `times` as a folder of frames; `progress` is
/// called with the number of finished frames.
///
/// # Errors
/// As [`FolderWriter`]; also if the scene cannot be evaluated.
pub fn write_folder(
    dir: &Path,
    scene: &dyn DynamicScene,
    times: &[f32],
    options: &WriteOptions,
    existing: Existing,
    progress: &mut dyn FnMut(usize),
) -> Result<(), IoError> {
    too_short(dir, times.len())?;
    let mut writer = FolderWriter::create(dir, existing)?;
    each_frame(scene, times, dir, |index, splats| {
        writer.push(splats, options)?;
        progress(index + 1);
        Ok(())
    })?;
    writer.finish()
}

/// Writes the scene at `times` as a folder of compressed frames and returns the losses; `progress`
/// is called with the number of finished frames. Without [`compressed_ply::WriteOptions::order`],
/// all frames have the order of the first one along a space-filling curve, so that rows persist.
///
/// # Errors
/// As [`FolderWriter`]; also if the scene cannot be evaluated.
pub fn write_compressed_folder(
    dir: &Path,
    scene: &dyn DynamicScene,
    times: &[f32],
    options: &compressed_ply::WriteOptions,
    existing: Existing,
    progress: &mut dyn FnMut(usize),
) -> Result<FormatLosses, IoError> {
    too_short(dir, times.len())?;
    let mut writer = FolderWriter::create(dir, existing)?;
    let (mut options, mut losses) = (options.clone(), FormatLosses::none());
    if options.sh_degree.is_none() {
        // One degree for all frames; most scenes need their highest degree in the first frame.
        let mut kept = 0;
        for &time in times {
            if kept == scene.sh_degree() {
                break;
            }
            let splats =
                scene.at(time).map_err(|error| IoError::content(dir, error.to_string()))?;
            kept = kept.max(compressed_ply::kept_degree(&splats));
        }
        options.sh_degree = Some(kept);
    }
    each_frame(scene, times, dir, |index, splats| {
        options.order.get_or_insert_with(|| compressed_ply::morton_order(splats));
        losses = writer.push_compressed(splats, &options)?;
        progress(index + 1);
        Ok(())
    })?;
    writer.finish()?;
    Ok(losses)
}

/// Writes the scene at `times` as a zip archive of frames; `progress` is
/// called with the number of finished frames.
///
/// # Errors
/// As [`ZipWriter`]; also if the scene cannot be evaluated.
pub fn write_zip(
    path: &Path,
    scene: &dyn DynamicScene,
    times: &[f32],
    options: &WriteOptions,
    existing: Existing,
    progress: &mut dyn FnMut(usize),
) -> Result<(), IoError> {
    too_short(path, times.len())?;
    let mut writer = ZipWriter::create(path, existing)?;
    each_frame(scene, times, path, |index, splats| {
        writer.push(splats, options)?;
        progress(index + 1);
        Ok(())
    })?;
    writer.finish()
}
