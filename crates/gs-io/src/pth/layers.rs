//! Builds layers of networks from the tensors of a file.

use super::{LayersError, Tensor};
use gs_deform::Linear;
use std::collections::BTreeMap;

/// Tensors by name.
#[derive(Debug)]
pub(crate) struct Layers<'a> {
    by_name: BTreeMap<String, Tensor<'a>>,
}

impl<'a> Layers<'a> {
    /// The last of equal names is used, as in Python.
    pub(crate) fn new(tensors: Vec<(String, Tensor<'a>)>) -> Self {
        Self { by_name: tensors.into_iter().collect() }
    }

    pub(crate) fn get(&self, name: &str) -> Option<&Tensor<'a>> {
        self.by_name.get(name)
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.by_name.contains_key(name)
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.by_name.keys().map(String::as_str)
    }

    /// A few of the names, and how many there are.
    pub(crate) fn summary(&self) -> String {
        let names: Vec<&str> = self.names().take(4).collect();
        let more = if self.by_name.len() > names.len() { ", …" } else { "" };
        format!("{} tensors ({}{more})", self.by_name.len(), names.join(", "))
    }

    pub(crate) fn need(&self, name: &str) -> Result<&Tensor<'a>, LayersError> {
        self.get(name)
            .ok_or_else(|| LayersError::Missing { name: name.to_owned(), found: self.summary() })
    }

    /// The values of a tensor of this shape.
    pub(crate) fn values(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, LayersError> {
        let tensor = self.need(name)?;
        if tensor.shape() != shape {
            return Err(LayersError::Shape {
                name: name.to_owned(),
                found: tensor.shape().to_vec(),
                expected: shape.to_vec(),
            });
        }
        Ok(tensor.to_f32s())
    }

    /// The layer with these weights and biases.
    pub(crate) fn linear(&self, name: &str) -> Result<Linear, LayersError> {
        let (weight, bias) =
            (self.need(&format!("{name}.weight"))?, self.need(&format!("{name}.bias"))?);
        match (weight.shape(), bias.shape()) {
            (&[outputs, inputs], &[biases]) if outputs == biases && inputs > 0 && outputs > 0 => {
                Ok(Linear { weight: weight.to_f32s(), bias: bias.to_f32s() })
            }
            (weight, bias) => Err(LayersError::Linear {
                name: name.to_owned(),
                weight: weight.to_vec(),
                bias: bias.to_vec(),
            }),
        }
    }

    /// The layer, if it exists.
    pub(crate) fn linear_if_there(&self, name: &str) -> Result<Option<Linear>, LayersError> {
        self.has(&format!("{name}.weight")).then(|| self.linear(name)).transpose()
    }

    /// Consecutive layers `name(0)`, `name(1)`, …
    pub(crate) fn sequence(
        &self,
        name: impl Fn(usize) -> String,
    ) -> Result<Vec<Linear>, LayersError> {
        // At most the number of tensors.
        (0..self.by_name.len())
            .map(name)
            .take_while(|name| self.has(&format!("{name}.weight")))
            .map(|name| self.linear(&name))
            .collect()
    }
}
