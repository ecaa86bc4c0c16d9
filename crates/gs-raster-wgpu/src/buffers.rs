//! [`GrowBuffer`]: a device buffer that is kept across frames and grows when a frame needs more.

use crate::{GpuContext, GpuError};
use wgpu::BufferUsages;

/// A storage buffer, allocated at first use. Its contents are lost when it grows.
///
/// A clone shares the memory until one of the two grows.
#[derive(Debug, Clone)]
pub struct GrowBuffer {
    what: &'static str,
    usage: BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

/// Zero-sized bindings are invalid, and a `vec4f` must fit.
const LEAST_BYTES: u64 = 16;
/// Uploads are flushed after this many bytes, so that staging memory stays bounded.
const FLUSH_BYTES: usize = 64 << 20;

impl GrowBuffer {
    /// A storage buffer.
    pub const fn storage(what: &'static str) -> Self {
        let usage =
            BufferUsages::STORAGE.union(BufferUsages::COPY_DST).union(BufferUsages::COPY_SRC);
        Self { what, usage, buffer: None }
    }

    /// A uniform buffer.
    pub const fn uniform(what: &'static str) -> Self {
        let usage = BufferUsages::UNIFORM.union(BufferUsages::COPY_DST);
        Self { what, usage, buffer: None }
    }

    /// A buffer that the CPU reads.
    pub const fn staging(what: &'static str) -> Self {
        let usage = BufferUsages::MAP_READ.union(BufferUsages::COPY_DST);
        Self { what, usage, buffer: None }
    }

    /// Ensures room for `bytes`.
    ///
    /// # Errors
    /// If that exceeds a limit of the device or its memory.
    pub fn ensure(&mut self, context: &GpuContext, bytes: u64) -> Result<&wgpu::Buffer, GpuError> {
        let bytes = bytes.max(LEAST_BYTES).next_multiple_of(LEAST_BYTES);
        if self.buffer.as_ref().is_none_or(|buffer| buffer.size() < bytes) {
            if self.usage.contains(BufferUsages::STORAGE) {
                context.check_size(self.what, bytes)?;
            }
            // The old buffer is dropped first, because both together may not fit.
            self.buffer = None;
            let (label, usage) = (Some(self.what), self.usage);
            let descriptor =
                wgpu::BufferDescriptor { label, size: bytes, usage, mapped_at_creation: false };
            let made = context.guarded(self.what, || context.device().create_buffer(&descriptor));
            let buffer = made.map_err(|error| match error {
                GpuError::Failed { message, .. } => {
                    context.memory_error(self.what, bytes, format!("has left ({message})"))
                }
                other => other,
            })?;
            self.buffer = Some(buffer);
        }
        self.get(context)
    }

    /// The buffer.
    ///
    /// # Errors
    /// If no memory was ever requested.
    pub fn get(&self, context: &GpuContext) -> Result<&wgpu::Buffer, GpuError> {
        self.buffer.as_ref().ok_or_else(|| context.failed("preparation", "buffer not allocated"))
    }

    /// Ensures room for `values` and uploads them in pieces.
    ///
    /// # Errors
    /// As [`GrowBuffer::ensure`].
    pub fn upload<T: bytemuck::NoUninit>(
        &mut self,
        context: &GpuContext,
        values: &[T],
    ) -> Result<(), GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let buffer = self.ensure(context, bytes.len() as u64)?;
        write(context, buffer, 0, bytes);
        Ok(())
    }
}

/// Uploads `bytes` to `offset`, in pieces.
pub fn write(context: &GpuContext, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
    let mut at = offset;
    for piece in bytes.chunks(FLUSH_BYTES) {
        context.queue().write_buffer(buffer, at, piece);
        at += piece.len() as u64;
        if piece.len() == FLUSH_BYTES {
            context.queue().submit([]);
        }
    }
}
