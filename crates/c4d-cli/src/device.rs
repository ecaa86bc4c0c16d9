//! Choice of the rasteriser: CPU, or GPU through wgpu.

#[cfg(feature = "gpu")]
use crate::failure::Exit;
use crate::failure::{Failure, Outcome};
#[cfg(not(feature = "gpu"))]
use crate::features::missing;
use gs_core::RasterError;
#[cfg(feature = "gpu")]
use gs_raster_wgpu::{AdapterChoice, AdapterKind, GpuContext, WgpuRasterizer};
use std::str::FromStr;

/// `--gpu`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum GpuChoice {
    /// A hardware adapter if there is one, else the CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The adapter with this number in `c4d doctor`, hardware or software.
    Index(usize),
}

impl FromStr for GpuChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            _ => text.parse().map(Self::Index).map_err(|_not_a_number| {
                format!("unknown device `{text}`: expected auto, cpu or the number of an adapter that c4d doctor lists")
            }),
        }
    }
}

/// The chosen rasteriser.
#[derive(Debug, Clone)]
pub(crate) enum Device {
    /// The CPU rasteriser.
    Cpu,
    /// The GPU rasteriser.
    #[cfg(feature = "gpu")]
    Gpu(WgpuRasterizer),
}

impl Device {
    /// Resolves the choice. Auto never fails: without a usable hardware adapter it is the CPU.
    #[cfg(feature = "gpu")]
    pub(crate) fn open(choice: GpuChoice) -> Outcome<Self> {
        let adapter = match choice {
            GpuChoice::Cpu => return Ok(Self::Cpu),
            GpuChoice::Auto if !has_hardware() => return Ok(Self::Cpu),
            GpuChoice::Auto => AdapterChoice::Auto,
            GpuChoice::Index(index) => AdapterChoice::Index(index),
        };
        match GpuContext::new(adapter) {
            Ok(context) => Ok(Self::Gpu(WgpuRasterizer::new(context))),
            Err(_) if choice == GpuChoice::Auto => Ok(Self::Cpu),
            Err(error) => {
                Err(Failure { exit: Exit::NoGpu, what: crate::failure::chain(&error), next: None }
                    .next("c4d doctor lists the adapters; --gpu cpu works without one."))
            }
        }
    }

    /// Resolves the choice: the CPU, or an error if an adapter was requested.
    #[cfg(not(feature = "gpu"))]
    pub(crate) fn open(choice: GpuChoice) -> Outcome<Self> {
        match choice {
            GpuChoice::Auto | GpuChoice::Cpu => Ok(Self::Cpu),
            GpuChoice::Index(_) => Err(missing("gpu", "--gpu cpu needs none")),
        }
    }

    /// Description for messages.
    pub(crate) fn describe(&self) -> String {
        match self {
            Self::Cpu => format!("CPU, {} threads", rayon::current_num_threads()),
            #[cfg(feature = "gpu")]
            Self::Gpu(raster) => raster.context().adapter().to_string(),
        }
    }
}

/// A rasteriser's error, with the next step for errors of the adapter.
pub(crate) fn failure(error: &RasterError) -> Failure {
    let failure = Failure::failed(crate::failure::chain(error));
    match error {
        RasterError::Device(_) => {
            failure.next("Smaller images need less memory on the adapter; --gpu cpu needs none.")
        }
        _ => failure,
    }
}

/// Restarts the program without Mesa's device selection if there is no desktop session. That Vulkan
/// layer queries the desktop for its adapter, and libwayland then prints errors about
/// `XDG_RUNTIME_DIR` that look like ours. The layer can be disabled only by an environment
/// variable, which cannot be changed in a running program.
pub(crate) fn without_desktop(choice: GpuChoice) {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::process::CommandExt;
        const OFF: &str = "NODEVICE_SELECT";
        let desktop = std::env::var_os("XDG_RUNTIME_DIR")
            .is_some_and(|folder| std::path::Path::new(&folder).is_absolute());
        if choice == GpuChoice::Cpu || desktop || std::env::var_os(OFF).is_some() {
            return;
        }
        let mut arguments = std::env::args_os();
        if let (Ok(own), Some(name)) = (std::env::current_exe(), arguments.next()) {
            // Returns only on failure; the only consequence is two additional lines of output.
            let _ = std::process::Command::new(own).arg0(name).args(arguments).env(OFF, "1").exec();
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = choice;
}

#[cfg(feature = "gpu")]
fn has_hardware() -> bool {
    GpuContext::adapters().iter().any(|adapter| adapter.kind == AdapterKind::Hardware)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_parse() {
        assert_eq!("auto".parse(), Ok(GpuChoice::Auto), "auto");
        assert_eq!("cpu".parse(), Ok(GpuChoice::Cpu), "cpu");
        assert_eq!("3".parse(), Ok(GpuChoice::Index(3)), "number");
        assert!("cuda".parse::<GpuChoice>().is_err(), "nothing else");
    }

    #[test]
    fn cpu_always_opens() {
        assert!(matches!(Device::open(GpuChoice::Cpu), Ok(Device::Cpu)), "cpu");
        assert!(Device::open(GpuChoice::Auto).is_ok(), "auto falls back");
    }
}
