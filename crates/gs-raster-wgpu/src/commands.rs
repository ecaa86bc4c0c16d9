//! [`Commands`]: a list of dispatches, clears and copies, submitted together.

use crate::buffers::{GrowBuffer, write};
use crate::kernels::{Access, KernelDef};
use crate::layout::FOLD;
use crate::{GpuContext, GpuError};
use std::sync::mpsc;

/// Time of one pass on the device.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct PassTiming {
    /// Name of the kernel.
    pub name: &'static str,
    /// Nanoseconds.
    pub nanoseconds: f64,
}

enum CommandStep {
    Dispatch {
        kernel: &'static KernelDef,
        uniform: (u64, u64),
        buffers: Vec<wgpu::Buffer>,
        groups: [u32; 2],
    },
    Clear {
        buffer: wgpu::Buffer,
        bytes: u64,
    },
    Copy {
        from: wgpu::Buffer,
        offset: u64,
        to: wgpu::Buffer,
        to_offset: u64,
        bytes: u64,
    },
}

/// Steps in execution order; nothing runs before [`Commands::submit`].
pub struct Commands<'a> {
    context: &'a GpuContext,
    uniforms: Vec<u8>,
    steps: Vec<CommandStep>,
}

impl std::fmt::Debug for Commands<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Commands").field("steps", &self.steps.len()).finish_non_exhaustive()
    }
}

/// Uniform and timestamp buffers, kept across frames.
#[derive(Debug)]
pub struct CommandMemory {
    uniforms: GrowBuffer,
    stamps: GrowBuffer,
}

impl Default for CommandMemory {
    fn default() -> Self {
        Self {
            uniforms: GrowBuffer::uniform("uniforms"),
            stamps: GrowBuffer::staging("timestamps"),
        }
    }
}

/// Groups of `size` invocations for `items`, folded into two dimensions.
pub(crate) fn groups_for(items: u64, size: u32) -> Option<[u32; 2]> {
    let groups = items.div_ceil(u64::from(size));
    if groups <= u64::from(FOLD) {
        return u32::try_from(groups).ok().map(|x| [x, u32::from(x > 0)]);
    }
    let rows = u32::try_from(groups.div_ceil(u64::from(FOLD))).ok()?;
    (rows <= FOLD).then_some([FOLD, rows])
}

impl<'a> Commands<'a> {
    /// An empty list for `context`.
    pub fn new(context: &'a GpuContext) -> Self {
        Self { context, uniforms: Vec::new(), steps: Vec::new() }
    }

    /// Runs `kernel` over `items` (invocations or, with `per_group` of them, whole groups); buffers
    /// in the order of its bindings.
    ///
    /// # Errors
    /// If there are more items than a dispatch can hold.
    pub fn dispatch<U: bytemuck::Pod>(
        &mut self,
        kernel: impl Into<&'static KernelDef>,
        uniform: &U,
        buffers: &[&wgpu::Buffer],
        items: u64,
        per_group: u32,
    ) -> Result<(), GpuError> {
        let kernel = kernel.into();
        let groups = groups_for(items, per_group)
            .ok_or_else(|| self.context.failed(kernel.name, "too many items for a dispatch"))?;
        self.dispatch_groups(kernel, uniform, buffers, groups);
        Ok(())
    }

    /// Runs `kernel` on a grid of groups.
    pub fn dispatch_groups<U: bytemuck::Pod>(
        &mut self,
        kernel: impl Into<&'static KernelDef>,
        uniform: &U,
        buffers: &[&wgpu::Buffer],
        groups: [u32; 2],
    ) {
        if groups.contains(&0) {
            return;
        }
        let align = self.context.device().limits().min_uniform_buffer_offset_alignment as usize;
        self.uniforms.resize(self.uniforms.len().next_multiple_of(align), 0);
        let offset = self.uniforms.len() as u64;
        let bytes = bytemuck::bytes_of(uniform);
        self.uniforms.extend_from_slice(bytes);
        self.steps.push(CommandStep::Dispatch {
            kernel: kernel.into(),
            uniform: (offset, bytes.len() as u64),
            buffers: buffers.iter().map(|&buffer| buffer.clone()).collect(),
            groups,
        });
    }

    /// Zeroes the first `bytes` of `buffer`.
    pub fn clear(&mut self, buffer: &wgpu::Buffer, bytes: u64) {
        if bytes > 0 {
            self.steps.push(CommandStep::Clear { buffer: buffer.clone(), bytes });
        }
    }

    /// Copies bytes between buffers.
    pub fn copy(
        &mut self,
        (from, offset): (&wgpu::Buffer, u64),
        (to, to_offset): (&wgpu::Buffer, u64),
        bytes: u64,
    ) {
        if bytes > 0 {
            let (from, to) = (from.clone(), to.clone());
            self.steps.push(CommandStep::Copy { from, offset, to, to_offset, bytes });
        }
    }

    /// Submits all steps as one command buffer; `during` describes them in
    /// errors. Returns the timestamps to read later.
    ///
    /// # Errors
    /// If a kernel does not compile, memory is exhausted, or the driver fails.
    pub fn submit(
        self,
        memory: &mut CommandMemory,
        during: &'static str,
    ) -> Result<Stamps, GpuError> {
        let context = self.context;
        let device = context.device();
        let uniforms = memory.uniforms.ensure(context, self.uniforms.len() as u64)?.clone();
        let mut names = Vec::new();
        for step in &self.steps {
            if let CommandStep::Dispatch { kernel, .. } = step {
                context.pipeline(kernel)?;
                names.push(kernel.name);
            }
        }
        let queries = u32::try_from(2 * names.len()).unwrap_or(u32::MAX);
        let timed = context.timestamp_period().is_some()
            && (2..=wgpu::QUERY_SET_MAX_QUERIES).contains(&queries);
        let stamp_bytes = u64::from(queries) * 8;
        let stamp_buffer =
            if timed { Some(memory.stamps.ensure(context, stamp_bytes)?.clone()) } else { None };
        context.guarded(during, || {
            write(context, &uniforms, 0, &self.uniforms);
            let mut encoder = device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(during) });
            let query_set = timed.then(|| {
                device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some(during),
                    ty: wgpu::QueryType::Timestamp,
                    count: queries,
                })
            });
            encode(context, &mut encoder, &self.steps, &uniforms, query_set.as_ref());
            if let (Some(query_set), Some(stamps)) = (&query_set, &stamp_buffer) {
                let resolved = device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("resolved timestamps"),
                    size: stamp_bytes,
                    usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                });
                encoder.resolve_query_set(query_set, 0..queries, &resolved, 0);
                encoder.copy_buffer_to_buffer(&resolved, 0, stamps, 0, stamp_bytes);
            }
            context.queue().submit([encoder.finish()]);
        })?;
        Ok(Stamps { names, buffer: stamp_buffer })
    }
}

fn encode(
    context: &GpuContext,
    encoder: &mut wgpu::CommandEncoder,
    steps: &[CommandStep],
    uniforms: &wgpu::Buffer,
    query_set: Option<&wgpu::QuerySet>,
) {
    let mut query = 0;
    let mut open: Option<wgpu::ComputePass<'static>> = None;
    for step in steps {
        match step {
            CommandStep::Clear { buffer, bytes } => {
                open = None;
                encoder.clear_buffer(buffer, 0, Some(bytes.next_multiple_of(4)));
            }
            CommandStep::Copy { from, offset, to, to_offset, bytes } => {
                open = None;
                encoder.copy_buffer_to_buffer(from, *offset, to, *to_offset, *bytes);
            }
            CommandStep::Dispatch { kernel, uniform, buffers, groups } => {
                // Compiled before encoding; an error was returned then.
                let Ok(pipeline) = context.pipeline(kernel) else { continue };
                if query_set.is_some() {
                    open = None;
                }
                let pass = open.get_or_insert_with(|| {
                    let timestamp_writes =
                        query_set.map(|query_set| wgpu::ComputePassTimestampWrites {
                            query_set,
                            beginning_of_pass_write_index: Some(query),
                            end_of_pass_write_index: Some(query + 1),
                        });
                    query += 2;
                    let label = Some(kernel.name);
                    encoder
                        .begin_compute_pass(&wgpu::ComputePassDescriptor {
                            label,
                            timestamp_writes,
                        })
                        .forget_lifetime()
                });
                let group = bind(context, kernel, &pipeline.layout, uniforms, *uniform, buffers);
                pass.set_pipeline(&pipeline.pipeline);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups(groups[0], groups[1], 1);
            }
        }
    }
}

fn bind(
    context: &GpuContext,
    kernel: &KernelDef,
    layout: &wgpu::BindGroupLayout,
    uniforms: &wgpu::Buffer,
    (offset, bytes): (u64, u64),
    buffers: &[wgpu::Buffer],
) -> wgpu::BindGroup {
    let mut buffers = buffers.iter();
    let mut entries = Vec::with_capacity(8);
    for (binding, access) in (0_u32..).zip(kernel.bindings) {
        let resource = match access {
            Access::None => continue,
            Access::Uniform => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: uniforms,
                offset,
                size: std::num::NonZeroU64::new(bytes),
            }),
            Access::Read | Access::Write => match buffers.next() {
                Some(buffer) => buffer.as_entire_binding(),
                None => continue,
            },
        };
        entries.push(wgpu::BindGroupEntry { binding, resource });
    }
    context.device().create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(kernel.name),
        layout,
        entries: &entries,
    })
}

/// Timestamps of a submission, if it was timed.
#[derive(Debug)]
pub struct Stamps {
    names: Vec<&'static str>,
    buffer: Option<wgpu::Buffer>,
}

impl Stamps {
    /// Waits for the submission and reads the timings; none without timestamps.
    ///
    /// # Errors
    /// If the device fails.
    pub fn read(self, context: &GpuContext) -> Result<Vec<PassTiming>, GpuError> {
        let (Some(buffer), Some(period)) = (self.buffer, context.timestamp_period()) else {
            return Ok(Vec::new());
        };
        let mut stamps = vec![0_u64; 2 * self.names.len()];
        read(context, &buffer, "timing", bytemuck::cast_slice_mut(&mut stamps))?;
        let pairs = self.names.iter().zip(stamps.as_chunks::<2>().0);
        Ok(pairs
            .map(|(&name, [begin, end])| PassTiming {
                name,
                nanoseconds: end.saturating_sub(*begin) as f64 * f64::from(period),
            })
            .collect())
    }
}

/// Waits for the device and copies the start of a staging buffer.
///
/// # Errors
/// If the device fails.
pub fn read(
    context: &GpuContext,
    buffer: &wgpu::Buffer,
    during: &'static str,
    target: &mut [u8],
) -> Result<(), GpuError> {
    let bytes = target.len() as u64;
    read_with(context, buffer, bytes, during, |view| target.copy_from_slice(view))
}

/// Waits for the device and passes the start of a staging buffer to a closure.
pub(crate) fn read_with(
    context: &GpuContext,
    buffer: &wgpu::Buffer,
    bytes: u64,
    during: &'static str,
    show: impl FnOnce(&[u8]),
) -> Result<(), GpuError> {
    if bytes == 0 {
        return Ok(());
    }
    let (sender, receiver) = mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
        // The receiver outlives the callback, so sending cannot fail.
        let _ = sender.send(result);
    });
    context
        .device()
        .poll(wgpu::PollType::wait_indefinitely())
        .map_err(|error| context.failed(during, error))?;
    let mapped = receiver.recv().map_err(|error| context.failed(during, error))?;
    mapped.map_err(|error| context.failed(during, error))?;
    let view = buffer.get_mapped_range(0..bytes).map_err(|error| context.failed(during, error))?;
    show(&view);
    drop(view);
    buffer.unmap();
    context.check_stray(during)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_dispatches_are_folded_into_two_dimensions() {
        assert_eq!(groups_for(0, 256), Some([0, 0]), "nothing");
        assert_eq!(groups_for(257, 256), Some([2, 1]), "one row");
        let at_limit = 65_535 * 256;
        assert_eq!(groups_for(at_limit, 256), Some([65_535, 1]), "a full row");
        assert_eq!(groups_for(at_limit + 1, 256), Some([65_535, 2]), "two rows");
        assert_eq!(groups_for(u64::MAX, 1), None, "too many");
    }
}
