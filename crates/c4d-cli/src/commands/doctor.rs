//! `c4d doctor`: whether and how fast this machine runs c4d.

use crate::args::Global;
use crate::camera_rig::DEFAULT_SIZE;
use crate::console::Console;
use crate::device::{Device, GpuChoice};
use crate::failure::{Failure, Outcome};
use crate::features;
use crate::renderer::Renderer;
#[cfg(feature = "gpu")]
use gs_raster_wgpu::{AdapterKind, GpuContext};
use serde_json::{Value, json};
use std::time::Instant;

/// Splats of the test scene.
const SPLATS: usize = 20_000;
/// Number of timed frames.
const FRAMES: usize = 5;

pub(crate) fn run(global: &Global, console: &Console) -> Outcome {
    let adapters = adapters();
    let device = Device::open(global.gpu)?;
    let threads = rayon::current_num_threads();
    let vector_units = vector_units();
    let temp = std::env::temp_dir();
    let writable = probe_write(&temp);
    let speed = render_speed(&device)?;
    let cpu_speed = match &device {
        Device::Cpu => None,
        #[cfg(feature = "gpu")]
        Device::Gpu(_) => Some(render_speed(&Device::Cpu)?),
    };
    console.report(|| {
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "debug_build": cfg!(debug_assertions),
            "threads": threads,
            "vector_units": vector_units,
            "renderer": device.describe(),
            "built_with": features::built_with(),
            "adapters": adapters.iter().map(|adapter| &adapter.json).collect::<Vec<_>>(),
            "frames_per_second": speed,
            "cpu_frames_per_second": cpu_speed.unwrap_or(speed),
            "temp_writable": writable.is_ok(),
        })
    });
    console.result(format!("c4d          {}", env!("CARGO_PKG_VERSION")));
    if cfg!(debug_assertions) {
        console.result("build        debug: about ten times slower than --release");
    }
    console.result(format!("built with   {}", features::built_with().join(", ")));
    console.result(format!("threads      {threads}"));
    console.result(format!("vector units {}", vector_units.join(", ")));
    for adapter in &adapters {
        console.result(format!("adapter      {}", adapter.text));
    }
    console.result(format!(
        "renderer     {} ({})",
        device.describe(),
        reason(global.gpu, &device, adapters.is_empty())
    ));
    console.result(format!(
        "speed        {speed:.1} frames/s ({SPLATS} splats, {}x{})",
        DEFAULT_SIZE.0, DEFAULT_SIZE.1
    ));
    if let Some(cpu) = cpu_speed {
        let (faster, slower) = if cpu > speed { (cpu, speed) } else { (speed, cpu) };
        let name = if cpu > speed { "the CPU rasteriser" } else { "the adapter" };
        console.result(format!(
            "on the CPU   {cpu:.1} frames/s: {name} is {:.1} times as fast",
            faster / slower
        ));
    }
    console.result(match &writable {
        Ok(()) => format!("temporary    {} is writable", temp.display()),
        Err(error) => format!("temporary    {} is not writable: {error}", temp.display()),
    });
    writable.map_err(|error| Failure::write(&temp, &error))
}

/// A graphics adapter, as a line and as JSON.
struct Adapter {
    text: String,
    json: Value,
}

#[cfg(feature = "gpu")]
fn adapters() -> Vec<Adapter> {
    let describe = |adapter: &gs_raster_wgpu::AdapterSummary| Adapter {
        text: adapter.to_string(),
        json: json!({
            "index": adapter.index,
            "name": adapter.name,
            "backend": adapter.backend,
            "driver": adapter.driver,
            "hardware": adapter.kind == AdapterKind::Hardware,
            "max_buffer_bytes": adapter.max_buffer_bytes,
            "max_binding_bytes": adapter.max_binding_bytes,
        }),
    };
    GpuContext::adapters().iter().map(describe).collect()
}

#[cfg(not(feature = "gpu"))]
fn adapters() -> Vec<Adapter> {
    Vec::new()
}

/// The reason why this device is used.
fn reason(choice: GpuChoice, device: &Device, no_adapters: bool) -> &'static str {
    match (choice, device) {
        (GpuChoice::Cpu | GpuChoice::Index(_), _) => "selected with `--gpu`",
        #[cfg(feature = "gpu")]
        (GpuChoice::Auto, Device::Gpu(_)) => "the best hardware adapter",
        (GpuChoice::Auto, Device::Cpu) if cfg!(not(feature = "gpu")) => {
            "this build has no GPU rasteriser"
        }
        (GpuChoice::Auto, Device::Cpu) if no_adapters => {
            "no graphics adapter found; none is needed"
        }
        (GpuChoice::Auto, Device::Cpu) => {
            "no usable hardware adapter; a software one is slower than the CPU rasteriser"
        }
    }
}

fn vector_units() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    {
        let candidates = [
            ("AVX-512", std::is_x86_feature_detected!("avx512f")),
            ("AVX2", std::is_x86_feature_detected!("avx2")),
            ("FMA", std::is_x86_feature_detected!("fma")),
        ];
        let found: Vec<_> =
            candidates.into_iter().filter(|(_, has)| *has).map(|(name, _)| name).collect();
        if found.is_empty() { vec!["SSE2"] } else { found }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        vec![std::env::consts::ARCH]
    }
}

fn probe_write(folder: &std::path::Path) -> std::io::Result<()> {
    let path = folder.join(format!(".c4d-doctor-{}", std::process::id()));
    std::fs::write(&path, b"c4d")?;
    std::fs::remove_file(&path)
}

/// Frames per second on the demo's scene; also checks that rendering
/// works, by testing that the image is not empty.
fn render_speed(device: &Device) -> Outcome<f64> {
    let params = gs_synth::DemoParams { num_splats: SPLATS, ..gs_synth::DemoParams::default() };
    let scene = gs_synth::demo(&params).map_err(Failure::failed)?;
    let camera = scene.front_camera(DEFAULT_SIZE.0, DEFAULT_SIZE.1);
    let mut renderer = Renderer::new(device, [0.0; 3]);
    renderer.seek(&scene, 0.0)?;
    let covered = renderer.render(&camera)?.alpha.iter().filter(|alpha| **alpha > 0.5).count();
    if covered < 1000 {
        return Err(Failure::failed(format!(
            "the renderer drew only {covered} pixels of the test scene"
        )));
    }
    let start = Instant::now();
    for frame in 0..FRAMES {
        renderer.seek(&scene, frame as f32 / FRAMES as f32)?;
        renderer.render(&camera)?;
    }
    Ok(FRAMES as f64 / start.elapsed().as_secs_f64())
}
