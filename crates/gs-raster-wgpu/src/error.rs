//! [`GpuError`]: errors of finding and using a graphics device.

use gs_core::RasterError;
use thiserror::Error;

/// Error of finding or using a graphics device.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GpuError {
    /// No suitable adapter.
    #[error(
        "no {wanted} graphics adapter found; adapters present: {present}. Install a Vulkan, Metal or Direct3D 12 driver, or use the CPU rasteriser"
    )]
    NoAdapter {
        /// Requested kind of adapter.
        wanted: &'static str,
        /// Adapters present.
        present: String,
    },
    /// The index is out of range.
    #[error("graphics adapter {index} does not exist, expected {expected}: {present}", expected = numbers(*count))]
    NoSuchAdapter {
        /// Requested index.
        index: usize,
        /// Number of adapters.
        count: usize,
        /// Adapters present.
        present: String,
    },
    /// The adapter lacks a required feature or failed to open.
    #[error("graphics adapter `{adapter}` cannot be used: {reason}")]
    Unusable {
        /// Name of the adapter.
        adapter: String,
        /// The missing feature, or the driver's message.
        reason: String,
    },
    /// A buffer exceeds a limit or the memory of the device.
    #[error("{what} needs {bytes} bytes, more than graphics adapter `{adapter}` {limit}")]
    DeviceMemory {
        /// Name of the buffer.
        what: &'static str,
        /// Size of the buffer, bytes.
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
        /// The operation that failed.
        during: &'static str,
        /// The driver's message.
        message: String,
    },
}

/// The valid indices of `count` adapters, for messages.
fn numbers(count: usize) -> String {
    if count > 1 { format!("0 to {}", count - 1) } else { "0".to_owned() }
}

impl From<GpuError> for RasterError {
    fn from(error: GpuError) -> Self {
        Self::Device(error.to_string())
    }
}
