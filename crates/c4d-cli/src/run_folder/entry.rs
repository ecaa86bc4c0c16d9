//! [`Entry`]: a tensor to be stored.

use safetensors::Dtype;

/// Name, type, shape and bytes of a tensor.
pub(super) type Entry = (&'static str, Dtype, Vec<usize>, Vec<u8>);

pub(super) fn le_bytes<T: Copy, const N: usize>(
    values: &[T],
    to_bytes: impl Fn(T) -> [u8; N],
) -> Vec<u8> {
    values.iter().flat_map(|&value| to_bytes(value)).collect()
}
