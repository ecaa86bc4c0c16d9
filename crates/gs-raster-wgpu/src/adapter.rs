//! [`AdapterSummary`]: the available graphics adapters, for display and selection.

use crate::GpuError;
use std::fmt;

/// Whether an adapter is a GPU or runs on the CPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum AdapterKind {
    /// A graphics processor.
    Hardware,
    /// A driver that runs on the CPU: correct, but slower than the CPU rasteriser. For tests.
    Software,
}

/// Which adapter to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum AdapterChoice {
    /// The best hardware adapter: discrete before integrated before virtual. Never software.
    #[default]
    Auto,
    /// The adapter with this index in [`crate::GpuContext::adapters`], of any kind.
    Index(usize),
    /// A software adapter, for tests.
    Software,
}

/// Description of one adapter.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct AdapterSummary {
    /// Position in [`crate::GpuContext::adapters`].
    pub index: usize,
    /// Name reported by the driver.
    pub name: String,
    /// Vulkan, Metal or Dx12.
    pub backend: String,
    /// discrete, integrated, virtual, CPU or other.
    pub device_type: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Hardware or software.
    pub kind: AdapterKind,
    /// Largest storage binding, bytes.
    pub max_binding_bytes: u64,
    /// Largest buffer, bytes.
    pub max_buffer_bytes: u64,
    /// Storage buffers per shader stage; 8 are required.
    pub max_storage_buffers: u32,
    /// Whether float atomics (addition) are supported.
    pub float_atomics: bool,
    /// Whether subgroup operations are supported.
    pub subgroups: bool,
    /// Whether timestamps of passes are supported.
    pub timestamps: bool,
    /// Preference rank; smaller is better.
    pub(crate) rank: u32,
}

impl AdapterSummary {
    pub(crate) fn new(index: usize, adapter: &wgpu::Adapter) -> Self {
        let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
        let (device_type, kind, rank) = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => ("discrete", AdapterKind::Hardware, 0),
            wgpu::DeviceType::IntegratedGpu => ("integrated", AdapterKind::Hardware, 1),
            wgpu::DeviceType::VirtualGpu => ("virtual", AdapterKind::Hardware, 2),
            wgpu::DeviceType::Other => ("other", AdapterKind::Hardware, 3),
            wgpu::DeviceType::Cpu => ("CPU", AdapterKind::Software, 4),
        };
        Self {
            index,
            name: info.name,
            backend: format!("{:?}", info.backend),
            device_type: device_type.to_owned(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            kind,
            max_binding_bytes: limits.max_storage_buffer_binding_size,
            max_buffer_bytes: limits.max_buffer_size,
            max_storage_buffers: limits.max_storage_buffers_per_shader_stage,
            float_atomics: features.contains(wgpu::Features::SHADER_FLOAT32_ATOMIC),
            subgroups: features.contains(wgpu::Features::SUBGROUP),
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            rank,
        }
    }
}

impl fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            AdapterKind::Hardware => "hardware",
            AdapterKind::Software => "software, slower than --gpu cpu",
        };
        let mib = |bytes: u64| bytes >> 20;
        write!(
            f,
            "[{}] {} ({}, {}, {kind}; {}): bindings to {} MiB, buffers to {} MiB",
            self.index,
            self.name,
            self.backend,
            self.device_type,
            self.driver,
            mib(self.max_binding_bytes),
            mib(self.max_buffer_bytes)
        )?;
        let extras = [
            (self.subgroups, "subgroups"),
            (self.float_atomics, "float atomics"),
            (self.timestamps, "timestamps"),
        ];
        for (_, name) in extras.iter().filter(|(present, _)| *present) {
            write!(f, ", {name}")?;
        }
        Ok(())
    }
}

/// Adapters as a list for messages.
fn listed(adapters: &[AdapterSummary]) -> String {
    if adapters.is_empty() {
        return "none".to_owned();
    }
    let lines: Vec<String> = adapters.iter().map(ToString::to_string).collect();
    lines.join("; ")
}

/// Index of the adapter selected by `choice`.
pub(crate) fn choose(
    adapters: &[AdapterSummary],
    choice: AdapterChoice,
) -> Result<usize, GpuError> {
    let best = |kind| {
        adapters
            .iter()
            .filter(|a| a.kind == kind)
            .min_by_key(|a| (a.rank, a.index))
            .map(|a| a.index)
    };
    match choice {
        AdapterChoice::Index(index) if index < adapters.len() => Ok(index),
        AdapterChoice::Index(_) if adapters.is_empty() => {
            Err(GpuError::NoAdapter { wanted: "usable", present: listed(adapters) })
        }
        AdapterChoice::Index(index) => {
            Err(GpuError::NoSuchAdapter { index, count: adapters.len(), present: listed(adapters) })
        }
        AdapterChoice::Auto => best(AdapterKind::Hardware)
            .ok_or_else(|| GpuError::NoAdapter { wanted: "hardware", present: listed(adapters) }),
        AdapterChoice::Software => best(AdapterKind::Software)
            .ok_or_else(|| GpuError::NoAdapter { wanted: "software", present: listed(adapters) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapter(index: usize, kind: AdapterKind, rank: u32) -> AdapterSummary {
        AdapterSummary {
            index,
            name: format!("adapter {index}"),
            backend: "Vulkan".to_owned(),
            device_type: "other".to_owned(),
            driver: "driver 1".to_owned(),
            kind,
            max_binding_bytes: 128 << 20,
            max_buffer_bytes: 256 << 20,
            max_storage_buffers: 8,
            float_atomics: false,
            subgroups: true,
            timestamps: false,
            rank,
        }
    }

    #[test]
    fn auto_selects_the_best_hardware_and_never_software() {
        let list = [
            adapter(0, AdapterKind::Software, 4),
            adapter(1, AdapterKind::Hardware, 1),
            adapter(2, AdapterKind::Hardware, 0),
        ];
        assert_eq!(choose(&list, AdapterChoice::Auto), Ok(2), "discrete");
        assert_eq!(choose(&list, AdapterChoice::Software), Ok(0), "software");
        assert_eq!(choose(&list, AdapterChoice::Index(1)), Ok(1), "by index");
        let error = choose(&list[..1], AdapterChoice::Auto).unwrap_err().to_string();
        assert!(error.contains("no hardware") && error.contains("adapter 0"), "{error}");
        let error = choose(&list, AdapterChoice::Index(7)).unwrap_err().to_string();
        assert!(error.contains("adapter 7 does not exist, expected 0 to 2"), "{error}");
        let error = choose(&list[..1], AdapterChoice::Index(7)).unwrap_err().to_string();
        assert!(error.contains("adapter 7 does not exist, expected 0:"), "{error}");
        let error = choose(&[], AdapterChoice::Index(0)).unwrap_err().to_string();
        assert!(error.contains("no usable") && error.contains("present: none"), "{error}");
        let error = choose(&[], AdapterChoice::Auto).unwrap_err().to_string();
        assert!(error.contains("adapters present: none"), "{error}");
    }
}
