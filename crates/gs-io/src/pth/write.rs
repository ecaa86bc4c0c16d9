//! Writes tensors by name in the format of `torch.save`: a stored
//! zip archive of a pickle and raw storages.

use crate::archive::StoredWriter;
use std::io::{self, Write};

/// Single-precision tensor to write, row-major.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamedTensor<'a> {
    /// Name in the dictionary.
    pub name: &'a str,
    /// Shape; its product is the number of values.
    pub shape: &'a [usize],
    /// Values, row-major.
    pub values: &'a [f32],
}

/// Opcodes of pickle protocol 2 used here.
mod op {
    pub(super) const PROTOCOL_2: [u8; 2] = [0x80, 2];
    pub(super) const MARK: u8 = b'(';
    pub(super) const TUPLE: u8 = b't';
    pub(super) const EMPTY_TUPLE: u8 = b')';
    pub(super) const GLOBAL: u8 = b'c';
    pub(super) const REDUCE: u8 = b'R';
    pub(super) const TEXT: u8 = b'X';
    pub(super) const LONG: u8 = 0x8a;
    pub(super) const FALSE: u8 = 0x89;
    pub(super) const PERSISTENT: u8 = b'Q';
    pub(super) const SET_ITEMS: u8 = b'u';
    pub(super) const STOP: u8 = b'.';
}

/// Writes an ordered dictionary of tensors, for PyTorch 1.6 and
/// later. Equal tensors give equal bytes.
///
/// # Errors
/// If a shape does not fit its values, or the stream cannot be written.
pub fn write(tensors: &[NamedTensor<'_>], out: impl Write) -> io::Result<()> {
    let mut pickle = Pickle(op::PROTOCOL_2.to_vec());
    pickle.ordered_dict();
    pickle.0.push(op::MARK);
    for (key, tensor) in tensors.iter().enumerate() {
        let values = tensor.shape.iter().try_fold(1_usize, |n, &d| n.checked_mul(d));
        if values != Some(tensor.values.len()) {
            let (name, shape, found) = (tensor.name, tensor.shape, tensor.values.len());
            let what = format!("tensor `{name}` of shape {shape:?} has {found} values");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
        }
        pickle.text(tensor.name);
        pickle.tensor(&key.to_string(), tensor);
    }
    pickle.0.extend([op::SET_ITEMS, op::STOP]);
    let mut archive = StoredWriter::new(out);
    archive.add("archive/data.pkl", &pickle.0)?;
    archive.add("archive/byteorder", b"little")?;
    for (key, tensor) in tensors.iter().enumerate() {
        let bytes: Vec<u8> = tensor.values.iter().flat_map(|value| value.to_le_bytes()).collect();
        archive.add(&format!("archive/data/{key}"), &bytes)?;
    }
    archive.add("archive/version", b"3\n")?;
    archive.finish()?.flush()
}

/// A pickle under construction.
struct Pickle(Vec<u8>);

impl Pickle {
    fn global(&mut self, module: &str, name: &str) {
        self.0.push(op::GLOBAL);
        self.0.extend(format!("{module}\n{name}\n").bytes());
    }

    fn text(&mut self, text: &str) {
        self.0.push(op::TEXT);
        // Names are far shorter than 4 GiB.
        let length = u32::try_from(text.len()).unwrap_or(u32::MAX);
        self.0.extend(length.to_le_bytes());
        self.0.extend(text.bytes());
    }

    fn integer(&mut self, value: usize) {
        // Two's complement; lengths never have the top bit set.
        self.0.extend([op::LONG, 8]);
        self.0.extend((value as u64).to_le_bytes());
    }

    fn tuple(&mut self, values: &[usize]) {
        self.0.push(op::MARK);
        for &value in values {
            self.integer(value);
        }
        self.0.push(op::TUPLE);
    }

    fn ordered_dict(&mut self) {
        self.global("collections", "OrderedDict");
        self.0.extend([op::EMPTY_TUPLE, op::REDUCE]);
    }

    /// `_rebuild_tensor_v2(storage, 0, shape, strides, False, OrderedDict())`.
    fn tensor(&mut self, key: &str, tensor: &NamedTensor<'_>) {
        self.global("torch._utils", "_rebuild_tensor_v2");
        self.0.extend([op::MARK, op::MARK]);
        self.text("storage");
        self.global("torch", "FloatStorage");
        self.text(key);
        self.text("cpu");
        self.integer(tensor.values.len());
        self.0.extend([op::TUPLE, op::PERSISTENT]);
        self.integer(0);
        self.tuple(tensor.shape);
        let mut strides = vec![1; tensor.shape.len()];
        for axis in (1..strides.len()).rev() {
            strides[axis - 1] = strides[axis] * tensor.shape[axis];
        }
        self.tuple(&strides);
        self.0.push(op::FALSE);
        self.ordered_dict();
        self.0.extend([op::TUPLE, op::REDUCE]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pth;

    #[test]
    fn written_tensors_are_read_back() {
        let values: Vec<f32> = (0..24_u8).map(|i| f32::from(i) - 3.5).collect();
        let tensors = [
            NamedTensor { name: "a.weight", shape: &[2, 3, 4], values: &values },
            NamedTensor { name: "b", shape: &[], values: &values[..1] },
            NamedTensor { name: "ä", shape: &[0, 7], values: &[] },
        ];
        let mut bytes = Vec::new();
        write(&tensors, &mut bytes).unwrap();
        let read = pth::read(&bytes).unwrap().into_state_dict().unwrap();
        assert_eq!(read.len(), 3, "all of them");
        for ((name, found), expected) in read.iter().zip(&tensors) {
            assert_eq!(name, expected.name, "order");
            assert_eq!(found.shape(), expected.shape, "{name}");
            assert_eq!(found.to_f32s(), expected.values, "{name}, bit for bit");
        }
    }

    #[test]
    fn wrong_shapes_are_refused() {
        let tensor = NamedTensor { name: "a", shape: &[2, 2], values: &[0.0] };
        let error = write(&[tensor], Vec::new()).unwrap_err().to_string();
        assert!(error.contains("`a` of shape [2, 2] has 1 values"), "{error}");
    }
}
