//! [`Root`]: the top-level object of a PyTorch file.

use super::{PthError, Tensor};

/// Top-level object of a PyTorch file.
#[derive(Debug, Clone, PartialEq)]
pub enum Root<'a> {
    /// Tensors by name, in file order; entries of other kinds are skipped. Names of
    /// tensors in nested dictionaries are joined with dots, without parts that come
    /// from wrapping a module (`module`, `_orig_mod`).
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

    /// The single tensor, or the only one of a dictionary.
    ///
    /// # Errors
    /// If the root is a dictionary with no or several tensors.
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
