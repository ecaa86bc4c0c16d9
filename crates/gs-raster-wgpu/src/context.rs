//! [`GpuContext`]: a device, its limits, and its compiled pipelines.

use crate::GpuError;
use crate::adapter::{AdapterChoice, AdapterSummary, choose};
use crate::kernels::{Access, DeviceFeatures, KernelDef};
use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Options for using a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct GpuOptions {
    /// Use only core WGSL and WebGPU's default limits, even if the adapter has more. Gradients are
    /// then identical from run to run. Default false.
    pub portable: bool,
    /// Make gradients identical from run to run by not using float
    /// atomics; needs more memory. Default false.
    pub deterministic: bool,
    /// Cap on the size of a storage binding, bytes. Default: the adapter's. Large arrays are split
    /// to fit.
    pub max_binding_bytes: Option<u64>,
    /// Time every pass where the adapter supports it; see [`crate::WgpuRasterizer::timings`].
    /// Default false, because timing prevents passes from overlapping.
    pub timestamps: bool,
}

/// A device. Cheap to clone; clones share it.
#[derive(Clone)]
pub struct GpuContext {
    inner: Arc<Inner>,
}

struct Inner {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: AdapterSummary,
    needs: DeviceFeatures,
    max_binding_bytes: u64,
    max_buffer_bytes: u64,
    timestamp_period: Option<f32>,
    /// Keyed by the address of the kernel's definition, so that
    /// kernels of other crates can be compiled too.
    pipelines: Mutex<HashMap<usize, Arc<Pipeline>>>,
    /// Error reported by the driver outside all error scopes.
    stray_error: Arc<Mutex<Option<String>>>,
}

/// A compiled kernel.
#[derive(Debug)]
pub(crate) struct Pipeline {
    pub layout: wgpu::BindGroupLayout,
    pub pipeline: wgpu::ComputePipeline,
}

impl fmt::Debug for GpuContext {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GpuContext").field("adapter", &self.inner.adapter).finish_non_exhaustive()
    }
}

fn enumerate() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY))
}

impl GpuContext {
    /// All available adapters, hardware and software.
    pub fn adapters() -> Vec<AdapterSummary> {
        enumerate().iter().enumerate().map(|(i, a)| AdapterSummary::new(i, a)).collect()
    }

    /// A device on the chosen adapter, with all its supported features and limits.
    ///
    /// # Errors
    /// If there is no such adapter or it cannot run the kernels.
    pub fn new(choice: AdapterChoice) -> Result<Self, GpuError> {
        Self::with_options(choice, GpuOptions::default())
    }

    /// A device on the chosen adapter.
    ///
    /// # Errors
    /// As [`GpuContext::new`].
    pub fn with_options(choice: AdapterChoice, options: GpuOptions) -> Result<Self, GpuError> {
        let adapters = enumerate();
        let summaries: Vec<AdapterSummary> =
            adapters.iter().enumerate().map(|(i, a)| AdapterSummary::new(i, a)).collect();
        let index = choose(&summaries, choice)?;
        let (adapter, summary) = (&adapters[index], summaries[index].clone());
        let unusable =
            |reason: String| GpuError::Unusable { adapter: summary.name.clone(), reason };

        let mut features = wgpu::Features::empty();
        if !options.portable {
            // The kernels have room for 16 subgroups per 64 lanes,
            // so subgroups need at least 4 lanes.
            if adapter.get_info().subgroup_min_size >= 4 {
                features |= wgpu::Features::SUBGROUP;
            }
            if !options.deterministic {
                features |= wgpu::Features::SHADER_FLOAT32_ATOMIC;
            }
        }
        if options.timestamps {
            features |= wgpu::Features::TIMESTAMP_QUERY;
        }
        features &= adapter.features();
        let limits = if options.portable { wgpu::Limits::default() } else { adapter.limits() };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("gs-raster-wgpu"),
            required_features: features,
            required_limits: limits,
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::Performance,
            trace: wgpu::Trace::Off,
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| unusable(error.to_string()))?;
        let limits = device.limits();
        if limits.max_storage_buffers_per_shader_stage < 8 {
            return Err(unusable(format!(
                "{} storage buffers per stage, expected 8",
                limits.max_storage_buffers_per_shader_stage
            )));
        }
        let stray_error = Arc::new(Mutex::new(None));
        let sink = Arc::clone(&stray_error);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            *sink.lock().unwrap_or_else(PoisonError::into_inner) = Some(error.to_string());
        }));
        let cap = options.max_binding_bytes.unwrap_or(u64::MAX);
        Ok(Self {
            inner: Arc::new(Inner {
                needs: DeviceFeatures {
                    subgroups: features.contains(wgpu::Features::SUBGROUP),
                    float_atomics: features.contains(wgpu::Features::SHADER_FLOAT32_ATOMIC),
                },
                max_binding_bytes: limits.max_storage_buffer_binding_size.min(cap),
                max_buffer_bytes: limits.max_buffer_size,
                timestamp_period: features
                    .contains(wgpu::Features::TIMESTAMP_QUERY)
                    .then(|| queue.get_timestamp_period()),
                pipelines: Mutex::new(HashMap::new()),
                adapter: summary,
                device,
                queue,
                stray_error,
            }),
        })
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterSummary {
        &self.inner.adapter
    }

    /// Whether `self` and `other` share one device.
    pub(crate) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.inner, &other.inner)
    }

    /// Optional features in use.
    pub fn features(&self) -> DeviceFeatures {
        self.inner.needs
    }

    /// The device, for passes of other crates.
    pub fn device(&self) -> &wgpu::Device {
        &self.inner.device
    }

    /// The queue of [`GpuContext::device`].
    pub fn queue(&self) -> &wgpu::Queue {
        &self.inner.queue
    }

    /// Largest storage binding used, bytes.
    pub fn max_binding_bytes(&self) -> u64 {
        self.inner.max_binding_bytes
    }

    /// Nanoseconds per timestamp tick; `None` without timestamps.
    pub(crate) fn timestamp_period(&self) -> Option<f32> {
        self.inner.timestamp_period
    }

    pub(crate) fn check_size(&self, what: &'static str, bytes: u64) -> Result<(), GpuError> {
        let allowed = self.inner.max_binding_bytes.min(self.inner.max_buffer_bytes);
        if bytes <= allowed {
            return Ok(());
        }
        Err(self.memory_error(what, bytes, format!("allows for one binding ({allowed})")))
    }

    pub(crate) fn memory_error(&self, what: &'static str, bytes: u64, limit: String) -> GpuError {
        GpuError::DeviceMemory { what, bytes, adapter: self.inner.adapter.name.clone(), limit }
    }

    /// The error for a failure during `during`.
    pub fn failed(&self, during: &'static str, message: impl std::fmt::Display) -> GpuError {
        let adapter = self.inner.adapter.name.clone();
        GpuError::Failed { adapter, during, message: message.to_string() }
    }

    /// Runs `work` inside error scopes and returns the first device error.
    pub(crate) fn guarded<T>(
        &self,
        during: &'static str,
        work: impl FnOnce() -> T,
    ) -> Result<T, GpuError> {
        let scopes = [
            wgpu::ErrorFilter::Internal,
            wgpu::ErrorFilter::Validation,
            wgpu::ErrorFilter::OutOfMemory,
        ]
        .map(|filter| self.inner.device.push_error_scope(filter));
        let value = work();
        let mut caught = None;
        // Innermost scope first.
        for scope in scopes.into_iter().rev() {
            let error = pollster::block_on(scope.pop());
            caught = caught.or(error);
        }
        match caught {
            Some(error) => Err(self.failed(during, error)),
            None => Ok(value),
        }
    }

    /// Fails if the driver reported an error outside all scopes since the last call.
    pub(crate) fn check_stray(&self, during: &'static str) -> Result<(), GpuError> {
        let stray = self.inner.stray_error.lock().unwrap_or_else(PoisonError::into_inner).take();
        stray.map_or(Ok(()), |message| Err(self.failed(during, message)))
    }

    /// The compiled kernel; compiled at first use.
    pub(crate) fn pipeline(&self, def: &'static KernelDef) -> Result<Arc<Pipeline>, GpuError> {
        let key = std::ptr::from_ref(def).addr();
        let known = || self.inner.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = known().get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        let pipeline = Arc::new(self.guarded(def.name, || compile(&self.inner.device, def))?);
        // Another thread may have inserted it meanwhile; both are equivalent.
        known().insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }
}

fn compile(device: &wgpu::Device, def: &KernelDef) -> Pipeline {
    let mut entries = Vec::new();
    for (binding, access) in (0_u32..).zip(def.bindings) {
        let ty = match access {
            Access::None => continue,
            Access::Uniform => wgpu::BufferBindingType::Uniform,
            Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
            Access::Write => wgpu::BufferBindingType::Storage { read_only: false },
        };
        entries.push(wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        });
    }
    let label = Some(def.name);
    let layout = device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label,
        source: wgpu::ShaderSource::Wgsl(def.source.text.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&pipeline_layout),
        module: &module,
        entry_point: Some(def.entry),
        compilation_options: wgpu::PipelineCompilationOptions {
            // Every kernel writes its workgroup memory before it reads it.
            zero_initialize_workgroup_memory: false,
            ..wgpu::PipelineCompilationOptions::default()
        },
        cache: None,
    });
    Pipeline { layout, pipeline }
}
