//! [`CamerasError`]: errors in camera files.

use gs_core::CameraError;
use thiserror::Error;

/// Error in a camera file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CamerasError {
    /// Not JSON, or not of the expected schema.
    #[error("not a {schema}: {source}")]
    Json {
        /// Name of the schema.
        schema: &'static str,
        /// Where and why.
        source: serde_json::Error,
    },
    /// An invalid camera.
    #[error("entry {index}: {source}")]
    Camera {
        /// Position in the list.
        index: usize,
        /// Cause of the error.
        source: CameraError,
    },
    /// No cameras.
    #[error("the list of cameras is empty, expected at least one")]
    Empty,
    /// The bytes end early, or a count exceeds the bytes left.
    #[error(
        "{at}: needs {needed} bytes, {left} are left; the file is truncated or of a different \
            kind"
    )]
    Truncated {
        /// Item being read.
        at: String,
        /// Minimum number of bytes it needs.
        needed: u64,
        /// Bytes that are left.
        left: usize,
    },
    /// An invalid value.
    #[error("{at}: expected {expected}, found {found}")]
    Malformed {
        /// Position in the file.
        at: String,
        /// Expected value.
        expected: String,
        /// Value found.
        found: String,
    },
    /// A lens model that a pinhole camera does not approximate.
    #[error(
        "camera {camera} has the unsupported lens model {model}; expected a pinhole camera with \
        moderate distortion: undistort the images (colmap image_undistorter) and use the model \
        that this command writes"
    )]
    Lens {
        /// Name of the camera.
        camera: String,
        /// Its lens model.
        model: String,
    },
}

impl CamerasError {
    #[expect(clippy::needless_pass_by_value, reason = "callers pass numbers and texts")]
    pub(crate) fn malformed(
        at: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self::Malformed { at: at.into(), expected: expected.into(), found: found.to_string() }
    }

    pub(crate) fn json(schema: &'static str) -> impl FnOnce(serde_json::Error) -> Self {
        move |source| Self::Json { schema, source }
    }
}
