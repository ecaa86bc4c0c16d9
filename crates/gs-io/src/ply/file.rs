//! PLY files by path.

use super::blocks::read_in_blocks;
use super::header::MAX_HEADER;
use super::{Header, PlyError, PlySplats, WriteOptions, read, write};
use crate::error::IoError;
use crate::fs::{AtomicFile, Existing};
use crate::fs::{read_bytes, refuse_stand_in};
use gs_core::Splats;
use std::path::Path;

/// Reads a 3DGS PLY file.
///
/// # Errors
/// If the file cannot be read or is not a 3DGS PLY.
pub fn read_file(path: &Path) -> Result<PlySplats, IoError> {
    match read_in_blocks(path)? {
        Some(read) => Ok(read),
        None => read(&read_bytes(path)?).map_err(IoError::format(path)),
    }
}

/// Reads the header of a PLY file without its data.
///
/// # Errors
/// If the file cannot be read or does not start with a PLY header.
pub fn read_header_file(path: &Path) -> Result<Header, IoError> {
    use std::io::Read;
    let failed = |source| IoError::Read { path: path.to_owned(), source };
    let mut file = crate::fs::open_file(path).map_err(failed)?;
    let mut bytes = Vec::new();
    // Headers of Gaussian files take about two kilobytes; only longer ones need a second read.
    for limit in [8 << 10, MAX_HEADER as u64] {
        let missing = limit - bytes.len() as u64;
        let read = (&mut file).take(missing).read_to_end(&mut bytes).map_err(failed)?;
        refuse_stand_in(path, &bytes)?;
        match Header::parse(&bytes) {
            Err(PlyError::Header(_)) if read as u64 == missing => {}
            result => return result.map_err(IoError::format(path)),
        }
    }
    Header::parse(&bytes).map_err(IoError::format(path))
}

/// Writes a 3DGS PLY file; it appears under its name only when complete.
///
/// # Errors
/// If the file exists and may not be replaced, or cannot be written.
pub fn write_file(
    path: &Path,
    splats: &Splats,
    options: &WriteOptions,
    existing: Existing,
) -> Result<(), IoError> {
    let mut file = AtomicFile::create(path, existing)?;
    write(splats, options, &mut file).map_err(IoError::write(path))?;
    file.commit()
}
