//! PyTorch archives (`.pth`): zip containers of a pickle and raw storages.
//!
//! The pickle is interpreted as data by a machine that knows some forty opcodes and a dozen names; nothing is ever
//! imported or executed. Objects of any other class are passed over, opcodes that checkpoints do not use are refused. Tensors stay
//! views of the file until asked for. Memory is bounded by a small multiple of the file.

mod names;
mod pickle;
mod tensor;
mod write;

pub use names::beside;
pub use tensor::{Dtype, Tensor};
pub use write::{NamedTensor, write};

use crate::error::{IoError, read_bytes};
use crate::zip::{self, ZipError};
use std::path::Path;
use thiserror::Error;

/// A PyTorch file that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PthError {
    /// The stream format of PyTorch before 1.6.
    #[error(
        "PyTorch file in the legacy (non-zip) format, which is not supported; load it with torch.load and save it again with torch.save of PyTorch 1.6 or later"
    )]
    Legacy,
    /// Not an archive.
    #[error("not a PyTorch file: it starts with {found}, expected a zip archive")]
    NotPth {
        /// First bytes, in hexadecimal.
        found: String,
    },
    /// The container is broken.
    #[error("PyTorch file: {0}")]
    Zip(#[from] ZipError),
    /// The container lacks a part.
    #[error("PyTorch file: no entry `{0}` in the archive")]
    MissingEntry(String),
    /// The pickle is broken or does what a checkpoint never does.
    #[error("PyTorch file: byte {at} of its pickle: {what}")]
    Pickle {
        /// Position.
        at: usize,
        /// What was found there.
        what: String,
    },
    /// A tensor does not fit its storage.
    #[error("PyTorch file: {0}")]
    Tensor(String),
    /// The file holds something other than tensors by name or a tensor.
    #[error("PyTorch file: it holds {found}, expected {expected}")]
    Root {
        /// What it holds.
        found: String,
        /// What was asked for.
        expected: &'static str,
    },
}

/// What a PyTorch file holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Root<'a> {
    /// Tensors by name, in file order; entries of other kinds are left out. Tensors in nested dictionaries have the names of these in
    /// front, with dots between; parts that only say how a module was wrapped (`module`, `_orig_mod`) are left out.
    StateDict(Vec<(String, Tensor<'a>)>),
    /// One tensor.
    Tensor(Tensor<'a>),
}

impl<'a> Root<'a> {
    /// The tensors by name.
    ///
    /// # Errors
    /// If the root is a single tensor.
    pub fn into_state_dict(self) -> Result<Vec<(String, Tensor<'a>)>, PthError> {
        match self {
            Self::StateDict(tensors) => Ok(tensors),
            Self::Tensor(_) => Err(PthError::Root {
                found: "a single tensor".to_owned(),
                expected: "tensors by name",
            }),
        }
    }

    /// The single tensor, or that of a dictionary of one.
    ///
    /// # Errors
    /// If the root is a dictionary of none or several.
    pub fn into_tensor(self) -> Result<Tensor<'a>, PthError> {
        match self {
            Self::Tensor(tensor) => Ok(tensor),
            Self::StateDict(mut tensors) if tensors.len() == 1 => Ok(tensors.remove(0).1),
            Self::StateDict(_) => Err(PthError::Root {
                found: "tensors by name".to_owned(),
                expected: "a single tensor",
            }),
        }
    }
}

/// First bytes of the legacy format: protocol 2, then its magic number as a ten-byte integer.
const LEGACY: [u8; 8] = [0x80, 0x02, 0x8a, 0x0a, 0x6c, 0xfc, 0x9c, 0x46];

/// Reads a PyTorch file; tensors are views of `bytes`.
///
/// # Errors
/// Says what is wrong with the container, the pickle or a tensor.
pub fn read(bytes: &[u8]) -> Result<Root<'_>, PthError> {
    if bytes.starts_with(&LEGACY) {
        return Err(PthError::Legacy);
    }
    if !bytes.starts_with(b"PK") {
        let found: Vec<String> = bytes.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
        let found = if found.is_empty() { "no bytes".to_owned() } else { found.join(" ") };
        return Err(PthError::NotPth { found });
    }
    let entries = zip::entries(bytes)?;
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
    pickle::load(pickle.data, &|key| {
        let name = format!("{top}data/{key}");
        entries.iter().find(|entry| entry.name == name).map(|entry| entry.data)
    })
}

/// Reads a PyTorch file and gives its root to `with`.
///
/// # Errors
/// If the file cannot be read, or `with` fails.
pub fn with_file<T>(
    path: impl AsRef<Path>,
    with: impl FnOnce(Root<'_>) -> Result<T, PthError>,
) -> Result<T, IoError> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    read(&bytes).and_then(with).map_err(|source| IoError::Pth { path: path.to_owned(), source })
}
