//! A number in a camera file, tolerant of other values.

use serde::{Deserialize, Serialize};

/// A number; NaN if the file has something else, so that only the camera that needs it is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "Option<f64>")]
pub(crate) struct Number(pub(crate) f64);

impl From<Option<f64>> for Number {
    fn from(value: Option<f64>) -> Self {
        Self(value.unwrap_or(f64::NAN))
    }
}
