//! [`GpuError`]: why there is no usable device, or why it gave up.

use gs_core::RasterError;
use thiserror::Error;

/// What can go wrong between us and a graphics processor.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GpuError {
    /// Nothing to run on.
    #[error(
        "no {wanted} graphics adapter found; adapters present: {present}. Install a Vulkan, Metal or Direct3D 12 driver, or use the CPU rasteriser"
    )]
    NoAdapter {
        /// What was requested.
        wanted: &'static str,
        /// What there is.
        present: String,
    },
    /// The index is out of range.
    #[error("graphics adapter {index} does not exist, expected {expected}: {present}", expected = numbers(*count))]
    NoSuchAdapter {
        /// Requested index.
        index: usize,
        /// Number of adapters.
        count: usize,
        /// What there is.
        present: String,
    },
    /// The adapter lacks something without which nothing runs.
    #[error("graphics adapter `{adapter}` cannot be used: {reason}")]
    Unusable {
        /// Its name.
        adapter: String,
        /// What is missing, or what the driver said.
        reason: String,
    },
    /// A buffer exceeds what the device allows or has.
    #[error("{what} needs {bytes} bytes, more than graphics adapter `{adapter}` {limit}")]
    Memory {
        /// Which buffer.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// Name of the adapter.
        adapter: String,
        /// The limit that is exceeded, or that memory is exhausted.
        limit: String,
    },
    /// The driver reported an error during work.
    #[error("graphics adapter `{adapter}` failed during {during}: {message}")]
    Failed {
        /// Name of the adapter.
        adapter: String,
        /// What was being done.
        during: &'static str,
        /// What the driver said.
        message: String,
    },
}

/// The numbers of `count` adapters.
fn numbers(count: usize) -> String {
    if count > 1 { format!("0 to {}", count - 1) } else { "0".to_owned() }
}

impl From<GpuError> for RasterError {
    fn from(error: GpuError) -> Self {
        Self::Device(error.to_string())
    }
}
