//! Forward and backward passes at 1352×1014 on the best available adapter, whose name is printed
//! first. Software adapters get a small scene. Compares the two backward passes with the forward
//! pass, and prints the times of single passes where the adapter has timestamps, and the times of
//! the CPU rasteriser on the same scene, interleaved.
//!
//! `C4D_BENCH_ADAPTER=<index>` selects an adapter; the default
//! is hardware if available, else software.

#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a bench prints and stops at the first error"
)]

use criterion::{BenchmarkId, Criterion};
use gs_core::{Camera, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads};
use gs_raster_cpu::CpuRasterizer;
use gs_raster_wgpu::{AdapterChoice, AdapterKind, GpuContext, GpuOptions, WgpuRasterizer};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::collections::BTreeMap;
use std::num::NonZero;
use std::time::{Duration, Instant};

/// Clustered means in front of the camera, log-normal scales, degree-3 harmonics.
fn scene(num: usize) -> Splats {
    let mut rng = Pcg64Mcg::seed_from_u64(num as u64);
    let mut splats = Splats::with_capacity(num, 3);
    let centers: Vec<[f32; 3]> =
        (0..64).map(|_| [0; 3].map(|_| rng.random_range(-1.5..1.5))).collect();
    let mut bell = || (0..4).map(|_| rng.random_range(-0.5_f32..0.5)).sum::<f32>();
    for i in 0..num {
        let center = centers[i % centers.len()];
        splats.means.push([0, 1, 2].map(|axis| center[axis] + 0.6 * bell()));
        splats.quats.push([0; 4].map(|_| bell()));
        splats.log_scales.push([0; 3].map(|_| -4.6 + 0.9 * bell()));
        splats.opacity_logits.push(1.0 + 3.0 * bell());
        splats.sh.push([0; 3].map(|_| 1.5 * bell()));
        splats.sh.extend((1..16).map(|_| [0.1 * bell(), 0.1 * bell(), 0.1 * bell()]));
    }
    splats
}

fn context(timestamps: bool) -> Option<GpuContext> {
    let mut options = GpuOptions::default();
    options.timestamps = timestamps;
    let make = |choice| GpuContext::with_options(choice, options);
    let chosen = match std::env::var("C4D_BENCH_ADAPTER") {
        Ok(index) => make(AdapterChoice::Index(index.parse().unwrap_or(usize::MAX))),
        Err(_) => make(AdapterChoice::Auto).or_else(|_| make(AdapterChoice::Software)),
    };
    chosen.inspect_err(|error| println!("no bench: {error}")).ok()
}

/// Times of the kernels of one forward and one backward pass, summed by name.
fn print_timings(splats: &Splats, camera: &Camera, upstream: &UpstreamGrads) {
    let Some(context) = context(true) else { return };
    if !context.adapter().timestamps {
        println!("this adapter cannot time passes");
        return;
    }
    let raster = WgpuRasterizer::new(context);
    let params = RenderParams::default();
    let Ok(mut prepared) = raster.prepare(splats, camera) else { return };
    for what in ["forward, with preparation", "backward"] {
        let done = if what == "backward" {
            // Runs twice, because the first run compiles the kernels.
            let mut run = || raster.backward(&mut prepared, splats, &[], &params, upstream);
            run().and_then(|_| run()).map(|_| ())
        } else {
            let first = raster.forward_on_device(&mut prepared, splats, &[], &params);
            let again = raster.prepare_into(splats, camera, &mut prepared);
            first.and(again).and(raster.forward_on_device(&mut prepared, splats, &[], &params))
        };
        if let Err(error) = done {
            println!("{what}: {error}");
            return;
        }
        let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
        for timing in raster.timings(&prepared) {
            *sums.entry(timing.name).or_default() += timing.nanoseconds * 1e-6;
        }
        println!("passes of {} splats, {what}, ms: {sums:.3?}", splats.len());
    }
}

/// Milliseconds of preparation plus forward pass, and of the backward pass, including the transfer
/// of images and gradients to the host.
fn lap<R: Rasterizer>(
    raster: &R,
    (splats, camera, upstream): (&Splats, &Camera, &UpstreamGrads),
    prepared: &mut Option<R::Prepared>,
) -> Option<[f64; 2]> {
    let params = RenderParams { depth: false, ..RenderParams::default() };
    let start = Instant::now();
    let prepared = match prepared {
        Some(prepared) => {
            raster.prepare_into(splats, camera, prepared).ok()?;
            prepared
        }
        none => none.insert(raster.prepare(splats, camera).ok()?),
    };
    raster.forward(prepared, splats, &[], &params).ok()?;
    let forward = start.elapsed();
    let start = Instant::now();
    raster.backward(prepared, splats, &[], &params, upstream).ok()?;
    Some([forward, start.elapsed()].map(|time| 1e3 * time.as_secs_f64()))
}

/// Runs the adapter and the CPU rasteriser alternately, so that both have the same machine load.
fn print_ratio(raster: &WgpuRasterizer, splats: &Splats, camera: &Camera, up: &UpstreamGrads) {
    let cpu = CpuRasterizer::default();
    let (mut on_gpu, mut on_cpu) = (None, None);
    let mut laps = Vec::new();
    // The first lap compiles the kernels.
    for round in 0..8 {
        let gpu = lap(raster, (splats, camera, up), &mut on_gpu);
        let cpu = lap(&cpu, (splats, camera, up), &mut on_cpu);
        if let (Some(gpu), Some(cpu), true) = (gpu, cpu, round > 0) {
            laps.push([gpu[0], gpu[1], cpu[0], cpu[1]]);
        }
    }
    let median = |column: usize| {
        let mut values: Vec<f64> = laps.iter().map(|lap| lap[column]).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let (num, threads) =
        (splats.len(), std::thread::available_parallelism().map_or(1, NonZero::get));
    for (k, what) in ["prepare and forward", "backward"].into_iter().enumerate() {
        let (gpu, cpu) = (median(k), median(k + 2));
        println!(
            "{what}, {num} splats: adapter {gpu:.1} ms, CPU rasteriser ({threads} threads) {cpu:.1} ms, adapter/CPU {:.2}",
            gpu / cpu
        );
    }
}

fn bench(criterion: &mut Criterion, context: &GpuContext) {
    let hardware = context.adapter().kind == AdapterKind::Hardware;
    let (sizes, width, height) = if hardware {
        (vec![10_000, 100_000, 1_000_000], 1352, 1014)
    } else {
        (vec![10_000], 338, 254)
    };
    let raster = WgpuRasterizer::new(context.clone());
    let camera = Camera::look_at([0.0, 0.0, -4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.8, width, height);
    let params = RenderParams { depth: false, ..RenderParams::default() };
    for num in sizes {
        let splats = scene(num);
        let upstream = UpstreamGrads {
            v_rgb: vec![1e-3; (3 * width * height) as usize],
            ..UpstreamGrads::default()
        };
        print_timings(&splats, &camera, &upstream);
        print_ratio(&raster, &splats, &camera, &upstream);
        let mut group = criterion.benchmark_group(format!("{width}x{height}"));
        group.sample_size(10).measurement_time(Duration::from_secs(3));
        group.warm_up_time(Duration::from_secs(1));
        let Ok(mut prepared) = raster.prepare(&splats, &camera) else { return };
        let mut out = RenderOutput::default();
        let mut grads = RenderGrads::default();
        group.bench_function(BenchmarkId::new("prepare_and_forward", num), |bencher| {
            bencher.iter(|| {
                raster.prepare_into(&splats, &camera, &mut prepared).unwrap();
                raster.forward_into(&mut prepared, &splats, &[], &params, &mut out).unwrap();
            });
        });
        group.bench_function(BenchmarkId::new("forward_prepared", num), |bencher| {
            bencher
                .iter(|| raster.forward_on_device(&mut prepared, &splats, &[], &params).unwrap());
        });
        group.bench_function(BenchmarkId::new("backward", num), |bencher| {
            bencher.iter(|| {
                raster
                    .backward_into(&mut prepared, &splats, &[], &params, &upstream, &mut grads)
                    .unwrap();
            });
        });
        group.bench_function(BenchmarkId::new("backward_colors", num), |bencher| {
            bencher.iter(|| {
                raster
                    .backward_colors_into(
                        &mut prepared,
                        &splats,
                        &[],
                        &params,
                        &upstream,
                        &mut grads,
                    )
                    .unwrap();
            });
        });
        group.finish();
    }
}

fn main() {
    let Some(context) = context(false) else { return };
    println!("adapter: {}", context.adapter());
    let mut criterion = Criterion::default().configure_from_args();
    bench(&mut criterion, &context);
    criterion.final_summary();
}
