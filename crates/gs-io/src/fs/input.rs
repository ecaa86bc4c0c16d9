//! Opening of input files, excluding special files that block or never end.

use super::atomic::special_name;
use crate::content::UnsupportedFormat;
use crate::error::IoError;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Opens a file, following links. FIFOs, which would block, and devices, which may never end, are
/// rejected, as are sockets and folders.
///
/// # Errors
/// If the path is not a regular file, or the file cannot be opened.
pub fn open_file(path: &Path) -> io::Result<File> {
    let found = std::fs::metadata(path)?;
    if found.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a folder, expected a file"));
    }
    if !found.is_file() {
        let what = format!("is {}, expected a file", special_name(found.file_type()));
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    File::open(path)
}

/// Memory needed besides that of a large file, bytes: stacks and small allocations of all threads.
const MARGIN: usize = 32 << 20;

/// Fails if there is no room for `needed` bytes, decoded from a file of `length` bytes, and a
/// margin.
///
/// # Errors
/// [`io::ErrorKind::OutOfMemory`] if there is not.
pub(crate) fn check_room(needed: usize, length: u64) -> io::Result<()> {
    let room = needed.checked_add(MARGIN);
    let has_room = room.is_some_and(|room| Vec::<u8>::new().try_reserve_exact(room).is_ok());
    if has_room { Ok(()) } else { Err(out_of_memory(length)) }
}

/// Reads a whole file opened by [`open_file`].
///
/// # Errors
/// As [`open_file`]; also if it does not fit into memory.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = open_file(path)?;
    let length = file.metadata()?.len();
    let mut bytes: Vec<u8> = Vec::new();
    // Twice the size, for the decoded data, plus a margin; tested before reading starts.
    let mut has_room = |length: usize| {
        let room = length.checked_mul(2).and_then(|twice| twice.checked_add(MARGIN));
        room.is_some_and(|room| bytes.try_reserve_exact(room).is_ok())
    };
    let room = usize::try_from(length).ok().filter(|&length| has_room(length));
    bytes.shrink_to(room.ok_or_else(|| out_of_memory(length))?);
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a whole file; every file reader uses this function or [`refuse_stand_in`].
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, IoError> {
    let bytes =
        read_file(path).map_err(|source| IoError::Read { path: path.to_owned(), source })?;
    refuse_stand_in(path, &bytes)?;
    Ok(bytes)
}

/// Rejects a stand-in for a file, given at least its first bytes.
pub(crate) fn refuse_stand_in(path: &Path, start: &[u8]) -> Result<(), IoError> {
    match UnsupportedFormat::stand_in(start) {
        Some(found) => Err(IoError::StandIn { path: path.to_owned(), found }),
        None => Ok(()),
    }
}

/// Names of the entries of a folder, sorted.
pub(crate) fn list_names(path: &Path) -> Result<Vec<String>, IoError> {
    let failed = |source| IoError::Read { path: path.to_owned(), source };
    let mut names = std::fs::read_dir(path)
        .map_err(failed)?
        .map(|entry| entry.map(|entry| entry.file_name().to_string_lossy().into_owned()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(failed)?;
    names.sort();
    Ok(names)
}

/// The error of a failed allocation, with its size.
fn out_of_memory(bytes: u64) -> io::Error {
    let what = format!("not enough memory for its {} MiB", bytes.div_ceil(1 << 20));
    io::Error::new(io::ErrorKind::OutOfMemory, what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_are_opened() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("file"), "text").unwrap();
        assert_eq!(read_file(&dir.path().join("file")).unwrap(), b"text", "a file");
        let refused = |path: &Path| open_file(path).unwrap_err().to_string();
        assert!(refused(dir.path()).contains("is a folder"), "a folder");
        #[cfg(unix)]
        {
            assert!(refused(Path::new("/dev/zero")).contains("is a device"), "a device");
            let socket = dir.path().join("socket");
            let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
            assert!(refused(&socket).contains("is a socket"), "a socket");
            let link = dir.path().join("link");
            std::os::unix::fs::symlink(dir.path().join("file"), &link).unwrap();
            assert_eq!(read_file(&link).unwrap(), b"text", "a link to a file");
        }
    }
}
