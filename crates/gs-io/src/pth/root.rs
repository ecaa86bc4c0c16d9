//! [`Root`]: the object that a PyTorch file holds.

use super::{PthError, Tensor};

/// What a PyTorch file holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Root<'a> {
    /// Tensors by name, in file order; entries of other kinds are left out. Tensors in nested
    /// dictionaries have the names of these in front, with dots between; parts that only say how a
    /// module was wrapped (`module`, `_orig_mod`) are left out.
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
