//! Arrays of a NumPy archive (`.npz`).

use super::Dynamic3dgsError;
use crate::archive::Archive;
use crate::cfg_args::{self, Value};
use std::io::Cursor;

const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header accepted, bytes; NumPy writes 118.
const MAX_HEADER: usize = 1024;

/// An open archive.
pub(super) struct Arrays {
    archive: Archive<Cursor<Vec<u8>>>,
    size: u64,
}

/// An array, row-major.
pub(super) struct Array {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f32>,
}

impl Arrays {
    pub(super) fn open(bytes: Vec<u8>) -> Result<Self, Dynamic3dgsError> {
        let size = bytes.len() as u64;
        let archive = Archive::open(Cursor::new(bytes)).map_err(Dynamic3dgsError::Archive)?;
        Ok(Self { archive, size })
    }

    /// An array of floating-point numbers.
    pub(super) fn read(&mut self, name: &str) -> Result<Array, Dynamic3dgsError> {
        let entry = format!("{name}.npy");
        if !self.archive.names().contains(&entry) {
            let names =
                self.archive.names().iter().take(12).map(|name| name.trim_end_matches(".npy"));
            return Err(Dynamic3dgsError::Missing {
                name: name.to_owned(),
                found: names.collect::<Vec<_>>().join(", "),
            });
        }
        // Random numbers hardly compress, so a valid archive does not decompress to much more.
        let limit = self.size.saturating_mul(64).max(1 << 20);
        let bytes = self.archive.read(&entry, limit).map_err(Dynamic3dgsError::Entry)?;
        parse(&bytes).map_err(|what| Dynamic3dgsError::Array { name: name.to_owned(), what })
    }

    /// The values of an array of this shape.
    pub(super) fn of_shape(
        &mut self,
        name: &str,
        shape: &[usize],
    ) -> Result<Vec<f32>, Dynamic3dgsError> {
        let array = self.read(name)?;
        if array.shape != shape {
            return Err(Dynamic3dgsError::Shape {
                name: name.to_owned(),
                found: array.shape,
                expected: format!("{shape:?}"),
            });
        }
        Ok(array.values)
    }
}

fn parse(bytes: &[u8]) -> Result<Array, String> {
    let malformed = || "has a malformed header; copy the file again".to_owned();
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(malformed)?;
    let (length, start) = match *rest {
        [1, _, a, b, ..] => (usize::from(u16::from_le_bytes([a, b])), 4),
        [2 | 3, _, a, b, c, d, ..] => {
            (usize::try_from(u32::from_le_bytes([a, b, c, d])).unwrap_or(usize::MAX), 6)
        }
        _ => return Err(malformed()),
    };
    if length > MAX_HEADER {
        return Err(malformed());
    }
    let header = rest.get(start..start + length).ok_or_else(malformed)?;
    let data = &rest[start + length..];
    // The header is a Python dictionary.
    let text = format!("Namespace(header={})", String::from_utf8_lossy(header).trim());
    let parsed = cfg_args::parse(&text).map_err(|_not_python| malformed())?;
    let value = |key: &str| parsed.get("header").and_then(|header| header.get(key));
    let Some(Value::List(sides)) = value("shape") else { return Err(malformed()) };
    let shape: Vec<usize> = sides
        .iter()
        .map(|side| side.as_u64().and_then(|side| usize::try_from(side).ok()))
        .collect::<Option<_>>()
        .ok_or_else(malformed)?;
    if value("fortran_order").and_then(Value::as_bool) == Some(true) {
        return Err("is in Fortran order, expected C order".to_owned());
    }
    let size = match value("descr").and_then(Value::as_str) {
        Some("<f4" | "=f4") => 4,
        Some("<f8" | "=f8") => 8,
        other => {
            return Err(format!(
                "has numbers of type {}, expected <f4 or <f8",
                other.unwrap_or("unknown")
            ));
        }
    };
    let count = shape.iter().try_fold(1_usize, |product, &side| product.checked_mul(side));
    let needed = count.and_then(|count| count.checked_mul(size));
    if needed != Some(data.len()) {
        return Err(format!(
            "of shape {shape:?} has {} bytes of numbers, which does not fit; copy the file again",
            data.len()
        ));
    }
    #[expect(clippy::cast_possible_truncation, reason = "Gaussians are single precision")]
    let values = if size == 4 {
        data.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    } else {
        data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes) as f32).collect()
    };
    Ok(Array { shape, values })
}
