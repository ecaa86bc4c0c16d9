//! [`WrongNetwork`]: error of building a network from tensors.

use crate::error::IoError;
use gs_deform::FieldError;
use std::path::Path;

/// Error of building a network from tensors.
#[derive(Debug)]
pub(crate) enum WrongNetwork {
    Content(String),
    Field(FieldError),
}

impl WrongNetwork {
    /// Converts to an error of a file.
    pub(crate) fn of(self, path: &Path) -> IoError {
        match self {
            Self::Content(what) => IoError::content(path, what),
            Self::Field(source) => IoError::Field { path: path.to_owned(), source },
        }
    }
}

impl From<String> for WrongNetwork {
    fn from(what: String) -> Self {
        Self::Content(what)
    }
}

impl From<FieldError> for WrongNetwork {
    fn from(source: FieldError) -> Self {
        Self::Field(source)
    }
}
