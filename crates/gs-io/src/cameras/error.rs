//! [`CamerasError`]: what is wrong inside a camera file.

use gs_core::CameraError;
use thiserror::Error;

/// A camera file that cannot be used.
#[derive(Debug, Error)]
pub enum CamerasError {
    /// Not JSON, or not the schema of this file.
    #[error("not a {schema}: {source}")]
    Json {
        /// Which schema.
        schema: &'static str,
        /// Where and why.
        source: serde_json::Error,
    },
    /// A camera that cannot see.
    #[error("entry {index}: {source}")]
    Camera {
        /// Position in the list.
        index: usize,
        /// What is wrong.
        source: CameraError,
    },
    /// No cameras.
    #[error("the list of cameras is empty, expected at least one")]
    Empty,
    /// The bytes end early, or a count asks for more than there are.
    #[error("{at}: needs {needed} bytes, {left} are left; the file is cut off or of another kind")]
    Truncated {
        /// What was being read.
        at: String,
        /// Bytes it needs at least.
        needed: u64,
        /// Bytes that are left.
        left: usize,
    },
    /// A value that does not fit.
    #[error("{at}: expected {expected}, found {found}")]
    Malformed {
        /// Where.
        at: String,
        /// What belongs there.
        expected: String,
        /// What is there.
        found: String,
    },
    /// A lens that no pinhole camera approximates.
    #[error(
        "camera {camera} has the lens model {model}; pinhole cameras with moderate distortion are read: \
         undistort the images (colmap image_undistorter) and give the model that makes"
    )]
    Lens {
        /// Which camera.
        camera: String,
        /// Its lens model.
        model: String,
    },
}

impl CamerasError {
    #[expect(clippy::needless_pass_by_value, reason = "numbers and texts alike are given")]
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
