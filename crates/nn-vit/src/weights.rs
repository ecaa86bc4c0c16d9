//! [`Weights`]: named tensors from any source.

use crate::NetworkError;
use ndarray::{Array1, Array2};
use std::collections::BTreeMap;

/// A tensor of 32-bit floats.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WeightTensor {
    /// Sizes, outermost first.
    pub shape: Vec<usize>,
    /// Row-major.
    pub values: Vec<f32>,
}

/// Tensors by name, as in a state dictionary of PyTorch.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weights(pub BTreeMap<String, WeightTensor>);

impl Weights {
    /// Whether there is a tensor of this name.
    pub fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// Number of consecutive layers `{prefix}{index}{suffix}`, from index 0.
    pub(crate) fn count(&self, prefix: &str, suffix: &str) -> usize {
        (0..self.0.len()).take_while(|index| self.has(&format!("{prefix}{index}{suffix}"))).count()
    }

    /// Shape of a tensor; empty if there is none.
    pub(crate) fn shape(&self, name: &str) -> &[usize] {
        self.0.get(name).map_or(&[], |tensor| &tensor.shape)
    }

    /// Values of a tensor of this shape, in which 0 stands for any size.
    pub(crate) fn values(
        &self,
        name: &str,
        expected: &[usize],
        kind: &'static str,
    ) -> Result<&[f32], NetworkError> {
        let tensor = self
            .0
            .get(name)
            .ok_or_else(|| NetworkError::Missing { name: name.to_owned(), expected: kind })?;
        let fits = tensor.shape.len() == expected.len()
            && tensor.shape.iter().zip(expected).all(|(found, size)| *size == 0 || found == size)
            && !tensor.values.is_empty()
            && tensor.shape.iter().product::<usize>() == tensor.values.len();
        if !fits {
            return Err(NetworkError::Shape {
                name: name.to_owned(),
                found: tensor.shape.clone(),
                expected: expected.to_vec(),
            });
        }
        if !tensor.values.iter().all(|value| value.is_finite()) {
            return Err(NetworkError::NotFinite { name: name.to_owned() });
        }
        Ok(&tensor.values)
    }

    pub(crate) fn vector(
        &self,
        name: &str,
        len: usize,
        kind: &'static str,
    ) -> Result<Array1<f32>, NetworkError> {
        Ok(Array1::from(self.values(name, &[len], kind)?.to_vec()))
    }

    pub(crate) fn matrix(
        &self,
        name: &str,
        [rows, columns]: [usize; 2],
        kind: &'static str,
    ) -> Result<Array2<f32>, NetworkError> {
        let values = self.values(name, &[rows, columns], kind)?;
        let [rows, columns] = [0, 1].map(|axis| self.shape(name)[axis]);
        Ok(matrix(rows, columns, values.to_vec()))
    }
}

/// A matrix from values of the right number.
pub(crate) fn matrix(rows: usize, columns: usize, values: Vec<f32>) -> Array2<f32> {
    Array2::from_shape_vec((rows, columns), values).unwrap_or_else(|_| Array2::zeros((0, 0)))
}
