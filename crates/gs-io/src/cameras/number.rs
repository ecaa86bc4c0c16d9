//! A number in a camera file; any other value is read as NaN.

use serde::{Deserialize, Serialize};

/// A number; NaN if the file contains another value, so that only the camera with it is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "Option<f64>")]
pub(crate) struct Number(pub(crate) f64);

impl From<Option<f64>> for Number {
    fn from(value: Option<f64>) -> Self {
        Self(value.unwrap_or(f64::NAN))
    }
}
