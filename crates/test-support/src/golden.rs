//! Golden tensors in safetensors files.

use safetensors::{Dtype, SafeTensors};
use std::path::Path;

/// A golden file in memory. Every accessor panics with the tensor's name if the tensor is missing
/// or of a different type: a missing golden is a failure, never a skip.
#[derive(Debug)]
pub struct Golden {
    bytes: Vec<u8>,
    name: String,
}

impl Golden {
    /// Reads the file.
    ///
    /// # Panics
    /// If the file is missing or not a safetensors file.
    pub fn open(path: impl AsRef<Path>) -> Self {
        let name = path.as_ref().display().to_string();
        let bytes = std::fs::read(&path)
            .unwrap_or_else(|error| panic!("golden {name} is missing: {error}"));
        if let Err(error) = SafeTensors::deserialize(&bytes) {
            panic!("golden {name} is not a safetensors file: {error}");
        }
        Self { bytes, name }
    }

    fn view(&self, tensor: &str) -> safetensors::tensor::TensorView<'_> {
        let file = SafeTensors::deserialize(&self.bytes)
            .unwrap_or_else(|error| panic!("golden {}: {error}", self.name));
        file.tensor(tensor)
            .unwrap_or_else(|error| panic!("golden {}: {tensor}: {error}", self.name))
    }

    fn typed(&self, tensor: &str, dtype: Dtype) -> safetensors::tensor::TensorView<'_> {
        let view = self.view(tensor);
        assert_eq!(view.dtype(), dtype, "golden {}: {tensor} has an unexpected type", self.name);
        view
    }

    /// Names of all tensors, sorted.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = SafeTensors::deserialize(&self.bytes)
            .map(|file| file.names().into_iter().map(str::to_owned).collect())
            .unwrap_or_default();
        names.sort();
        names
    }

    /// Whether the file has this tensor.
    pub fn has(&self, tensor: &str) -> bool {
        self.names().iter().any(|name| name == tensor)
    }

    /// Shape of a tensor.
    pub fn shape(&self, tensor: &str) -> Vec<usize> {
        self.view(tensor).shape().to_vec()
    }

    /// An F32 tensor, row-major.
    pub fn f32s(&self, tensor: &str) -> Vec<f32> {
        let view = self.typed(tensor, Dtype::F32);
        view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    }

    /// An F64 tensor, or an F32 one widened, row-major.
    pub fn f64s(&self, tensor: &str) -> Vec<f64> {
        if self.view(tensor).dtype() == Dtype::F32 {
            return self.f32s(tensor).into_iter().map(f64::from).collect();
        }
        let view = self.typed(tensor, Dtype::F64);
        view.data().as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
    }

    /// An I32 tensor, row-major.
    pub fn i32s(&self, tensor: &str) -> Vec<i32> {
        let view = self.typed(tensor, Dtype::I32);
        view.data().as_chunks::<4>().0.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect()
    }

    /// An I64 tensor, row-major.
    pub fn i64s(&self, tensor: &str) -> Vec<i64> {
        let view = self.typed(tensor, Dtype::I64);
        view.data().as_chunks::<8>().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect()
    }

    /// A U8 tensor, row-major.
    pub fn u8s(&self, tensor: &str) -> Vec<u8> {
        self.typed(tensor, Dtype::U8).data().to_vec()
    }
}
