//! Reading PyTorch files.

use super::{Integers, PthError, Root, legacy, pickle};
use crate::archive;
use crate::error::IoError;
use crate::fs::read_bytes;
use std::path::Path;

/// Reads a PyTorch file; tensors are views of `bytes`.
///
/// # Errors
/// Describes the error in the container, the pickle or a tensor.
pub fn read(bytes: &[u8]) -> Result<Root<'_>, PthError> {
    Ok(read_with_integers(bytes)?.0)
}

/// As [`read`], and the integers and flags of the outermost dictionary.
pub(crate) fn read_with_integers(bytes: &[u8]) -> Result<(Root<'_>, Integers), PthError> {
    if legacy::is_legacy(bytes) {
        return legacy::read(bytes);
    }
    if !bytes.starts_with(b"PK") {
        let found: Vec<String> = bytes.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
        let found = if found.is_empty() { "no bytes".to_owned() } else { found.join(" ") };
        return Err(PthError::NotPth { found });
    }
    let entries = archive::entries(bytes)?;
    let pickle = entries
        .iter()
        .find(|entry| entry.name.ends_with("/data.pkl") || entry.name == "data.pkl")
        .ok_or_else(|| PthError::MissingEntry("…/data.pkl".to_owned()))?;
    let top = pickle.name.trim_end_matches("data.pkl");
    if let Some(order) = entries.iter().find(|entry| entry.name == format!("{top}byteorder"))
        && order.data.trim_ascii() != b"little"
    {
        return Err(PthError::Tensor("big-endian storages are not supported".to_owned()));
    }
    pickle::load(pickle.data, &|key, _| {
        let name = format!("{top}data/{key}");
        entries.iter().find(|entry| entry.name == name).map(|entry| entry.data)
    })
}

/// Reads a PyTorch file and passes its root to `with`.
///
/// # Errors
/// If the file cannot be read, or `with` fails.
pub fn with_file<T>(
    path: &Path,
    with: impl FnOnce(Root<'_>) -> Result<T, PthError>,
) -> Result<T, IoError> {
    let bytes = read_bytes(path)?;
    read(&bytes).and_then(with).map_err(IoError::format(path))
}
