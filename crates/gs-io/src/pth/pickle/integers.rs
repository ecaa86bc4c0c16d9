//! Integers stored with the tensors.

use std::collections::BTreeMap;

/// Integers and flags (0 or 1) of the outermost dictionary, by name.
pub(crate) type Integers = BTreeMap<String, i64>;

/// A little-endian two's-complement integer of up to eight bytes.
pub(super) fn long(raw: &[u8]) -> Option<i64> {
    if raw.len() > 8 {
        return None;
    }
    let negative = raw.last().is_some_and(|byte| byte & 0x80 != 0);
    let mut bytes = [if negative { 0xff } else { 0 }; 8];
    bytes[..raw.len()].copy_from_slice(raw);
    Some(i64::from_le_bytes(bytes))
}
