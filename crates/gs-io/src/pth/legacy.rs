//! The stream format of PyTorch before 1.6: pickles of a magic number, a version, the system and
//! the object, then the keys of the storages, and the storages: a count of elements, then the
//! elements.

use super::pickle::{self, Integers};
use super::{PthError, Root};
use std::cell::RefCell;
use std::collections::BTreeMap;

/// First bytes: protocol 2, then the magic number as a ten-byte integer.
const MAGIC: [u8; 8] = [0x80, 0x02, 0x8a, 0x0a, 0x6c, 0xfc, 0x9c, 0x46];
/// Pickles before that of the object.
const HEADERS: usize = 3;

/// Whether a file has this format.
pub(super) fn is_legacy(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// The object, and the integers and flags of its outermost dictionary.
pub(super) fn read(bytes: &[u8]) -> Result<(Root<'_>, Integers), PthError> {
    let mut rest = bytes;
    for _ in 0..HEADERS {
        rest = &rest[pickle::scan(rest, &|_, _| None)?.0..];
    }
    let object = rest;
    // The sizes of the storages are in the object, which comes first. While they are collected,
    // arbitrary bytes of the right length replace the storages.
    let sizes = RefCell::new(BTreeMap::new());
    let (len, _) = pickle::scan(object, &|key, size| {
        sizes.borrow_mut().insert(key.to_owned(), size);
        bytes.get(..size)
    })?;
    let (keys_len, keys) = pickle::scan(&object[len..], &|_, _| None)?;
    let mut rest = &object[len + keys_len..];
    let mut storages = BTreeMap::new();
    for key in keys {
        let sizes = sizes.borrow();
        let size = *sizes
            .get(key)
            .ok_or_else(|| PthError::Legacy(format!("no tensor uses storage {key}")))?;
        let (count, after) = rest
            .split_first_chunk::<8>()
            .ok_or_else(|| PthError::Legacy(format!("it ends before storage {key}")))?;
        let count = usize::try_from(u64::from_le_bytes(*count)).unwrap_or(usize::MAX);
        let fits = if count == 0 { size == 0 } else { size % count == 0 };
        let data = after.get(..size).filter(|_| fits).ok_or_else(|| {
            PthError::Legacy(format!(
                "storage {key} should have {size} bytes; found {count} elements, {} bytes left",
                after.len()
            ))
        })?;
        storages.insert(key, data);
        rest = &after[size..];
    }
    pickle::load(object, &|key, _| storages.get(key).copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn heads() -> Vec<u8> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/nn-vit/lpips_alex.pth");
        fs::read(path).unwrap()
    }

    #[test]
    fn published_heads_are_read() {
        let bytes = heads();
        let tensors = read(&bytes).unwrap().0.into_state_dict().unwrap();
        let names: Vec<&str> = tensors.iter().map(|(name, _)| name.as_str()).collect();
        let expected: Vec<String> = (0..5).map(|n| format!("lin{n}.model.1.weight")).collect();
        assert_eq!(names, expected, "in order");
        // Means and largest values as computed by PyTorch.
        let known = [(0.03671, 0.49214), (0.08408, 1.04716), (0.10226, 1.32357)];
        for ((name, tensor), (mean, most)) in tensors.iter().zip(known) {
            let values = tensor.to_f32s();
            let found = values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64;
            assert!((found - mean).abs() < 1e-5, "{name}: mean {found}");
            let largest = values.iter().copied().fold(0.0, f32::max);
            assert!((f64::from(largest) - most).abs() < 1e-5, "{name}: largest {largest}");
            assert_eq!(tensor.shape()[2..], [1, 1], "{name}");
        }
    }

    #[test]
    fn damaged_streams_are_errors_or_other_values() {
        let whole = heads();
        for len in (0..whole.len()).step_by(7) {
            assert!(super::super::read(&whole[..len]).is_err(), "cut to {len} bytes");
        }
        for at in 0..whole.len().min(1200) {
            for value in [0, 0x28, 0x7f, 0xff] {
                let mut damaged = whole.clone();
                damaged[at] = value;
                let _ = super::super::read(&damaged);
            }
        }
    }
}
