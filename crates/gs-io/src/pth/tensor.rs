//! Tensors as views of a PyTorch file.

use super::PthError;

/// Type of a tensor's elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dtype {
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
    /// 16-bit float.
    F16,
    /// 16-bit float with an 8-bit exponent.
    Bf16,
    /// 64-bit integer.
    I64,
    /// 32-bit integer.
    I32,
    /// 16-bit integer.
    I16,
    /// 8-bit integer.
    I8,
    /// Byte.
    U8,
    /// Boolean, one byte.
    Bool,
}

impl Dtype {
    /// From the name of a storage class.
    pub(crate) fn from_storage(class: &str) -> Option<Self> {
        Some(match class {
            "FloatStorage" => Self::F32,
            "DoubleStorage" => Self::F64,
            "HalfStorage" => Self::F16,
            "BFloat16Storage" => Self::Bf16,
            "LongStorage" => Self::I64,
            "IntStorage" => Self::I32,
            "ShortStorage" => Self::I16,
            "CharStorage" => Self::I8,
            "ByteStorage" => Self::U8,
            "BoolStorage" => Self::Bool,
            _ => return None,
        })
    }

    /// Bytes of an element.
    pub const fn size(self) -> usize {
        match self {
            Self::F64 | Self::I64 => 8,
            Self::F32 | Self::I32 => 4,
            Self::F16 | Self::Bf16 | Self::I16 => 2,
            Self::I8 | Self::U8 | Self::Bool => 1,
        }
    }

    fn read(self, raw: &[u8]) -> f64 {
        fn take<const N: usize>(raw: &[u8]) -> [u8; N] {
            let mut out = [0; N];
            out.copy_from_slice(&raw[..N]);
            out
        }
        match self {
            Self::F32 => f32::from_le_bytes(take(raw)).into(),
            Self::F64 => f64::from_le_bytes(take(raw)),
            Self::F16 => half::f16::from_le_bytes(take(raw)).into(),
            Self::Bf16 => half::bf16::from_le_bytes(take(raw)).into(),
            #[expect(clippy::cast_precision_loss, reason = "large integers are rounded")]
            Self::I64 => i64::from_le_bytes(take(raw)) as f64,
            Self::I32 => i32::from_le_bytes(take(raw)).into(),
            Self::I16 => i16::from_le_bytes(take(raw)).into(),
            Self::I8 => i8::from_le_bytes(take(raw)).into(),
            Self::U8 | Self::Bool => raw[0].into(),
        }
    }
}

/// A tensor whose elements are still in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor<'a> {
    dtype: Dtype,
    shape: Vec<usize>,
    strides: Vec<usize>,
    /// Bytes from the first element.
    bytes: &'a [u8],
}

impl<'a> Tensor<'a> {
    /// A view of `storage`; `offset` and `strides` in elements.
    ///
    /// # Errors
    /// If an element would be outside the storage, or the tensor has more elements than the
    /// storage.
    pub(crate) fn new(
        dtype: Dtype,
        storage: &'a [u8],
        offset: usize,
        shape: Vec<usize>,
        strides: Vec<usize>,
    ) -> Result<Self, PthError> {
        let refuse = |what: &str| {
            Err(PthError::Tensor(format!(
                "a tensor of shape {shape:?} and strides {strides:?} {what}"
            )))
        };
        if shape.len() != strides.len() {
            return refuse("has different numbers of strides and axes");
        }
        let available = storage.len() / dtype.size();
        let count = shape.iter().try_fold(1_usize, |product, &length| product.checked_mul(length));
        // Views that repeat elements could have any size; checkpoints do not contain them.
        let Some(count) = count.filter(|&count| count <= available) else {
            return refuse(&format!("has more elements than its storage of {available}"));
        };
        let last = shape.iter().zip(&strides).try_fold(offset, |sum, (&length, &stride)| {
            sum.checked_add(length.saturating_sub(1).checked_mul(stride)?)
        });
        let fits = count == 0 || last.is_some_and(|last| last < available);
        if !fits {
            return refuse(&format!("reaches beyond its storage of {available} elements"));
        }
        let bytes = if count == 0 { &[][..] } else { &storage[offset * dtype.size()..] };
        Ok(Self { dtype, shape, strides, bytes })
    }

    /// Type of the elements.
    pub fn dtype(&self) -> Dtype {
        self.dtype
    }

    /// Lengths of the axes.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether elements are stored in the order of their indices.
    fn is_contiguous(&self) -> bool {
        let mut expected = 1;
        self.shape.iter().zip(&self.strides).rev().all(|(&length, &stride)| {
            let fits = length == 1 || stride == expected;
            expected *= length;
            fits
        })
    }

    /// All elements as `f32`, row-major (last axis fastest); doubles and integers are rounded,
    /// booleans are 0 or 1.
    pub fn to_f32s(&self) -> Vec<f32> {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "rounding to single precision is \
            intended"
        )]
        self.map(|value| value as f32)
    }

    /// All elements as `f64`, row-major; integers beyond 2⁵³ are rounded.
    pub fn to_f64s(&self) -> Vec<f64> {
        self.map(|value| value)
    }

    fn map<T>(&self, convert: impl Fn(f64) -> T) -> Vec<T> {
        let count = self.len();
        let size = self.dtype.size();
        if self.is_contiguous() {
            let elements = self.bytes[..count * size].chunks_exact(size);
            return elements.map(|raw| convert(self.dtype.read(raw))).collect();
        }
        let mut out = Vec::with_capacity(count);
        let mut index = vec![0; self.shape.len()];
        for _ in 0..count {
            let at: usize = index.iter().zip(&self.strides).map(|(i, stride)| i * stride).sum();
            out.push(convert(self.dtype.read(&self.bytes[at * size..])));
            for axis in (0..index.len()).rev() {
                index[axis] += 1;
                if index[axis] < self.shape[axis] {
                    break;
                }
                index[axis] = 0;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strides_and_types_are_honoured() {
        let storage: Vec<u8> = (0_u8..6).flat_map(|v| f32::from(v).to_le_bytes()).collect();
        let transposed = Tensor::new(Dtype::F32, &storage, 0, vec![3, 2], vec![1, 3]).unwrap();
        assert_eq!(transposed.to_f32s(), [0.0, 3.0, 1.0, 4.0, 2.0, 5.0], "transposed");
        let tail = Tensor::new(Dtype::F32, &storage, 4, vec![2], vec![1]).unwrap();
        assert_eq!(tail.to_f32s(), [4.0, 5.0], "offset");
        let scalar = Tensor::new(Dtype::F32, &storage, 5, vec![], vec![]).unwrap();
        assert_eq!(scalar.to_f32s(), [5.0], "no axes");
        let halves = [half::f16::from_f32(1.5).to_le_bytes(), half::f16::NEG_ONE.to_le_bytes()];
        let halves = Tensor::new(Dtype::F16, halves.as_flattened(), 0, vec![2], vec![1]).unwrap();
        assert_eq!(halves.to_f32s(), [1.5, -1.0], "half precision");
        let empty = Tensor::new(Dtype::Bool, &[], 0, vec![0, 3], vec![3, 1]).unwrap();
        assert!(empty.to_f32s().is_empty(), "empty");
    }

    #[test]
    fn views_outside_their_storage_are_refused() {
        let storage = [0; 16];
        let make = |offset, shape: &[usize], strides: &[usize]| {
            Tensor::new(Dtype::F32, &storage, offset, shape.to_vec(), strides.to_vec())
        };
        assert!(make(0, &[4], &[1]).is_ok(), "fits");
        assert!(make(1, &[4], &[1]).is_err(), "offset");
        assert!(make(0, &[2], &[4]).is_err(), "stride");
        assert!(make(0, &[1 << 40], &[0]).is_err(), "repeats one element");
        assert!(make(0, &[usize::MAX, 3], &[1, 1]).is_err(), "overflow");
        assert!(make(0, &[2, 2], &[usize::MAX, 1]).is_err(), "stride overflow");
        assert!(make(0, &[2], &[1, 1]).is_err(), "axes");
    }
}
