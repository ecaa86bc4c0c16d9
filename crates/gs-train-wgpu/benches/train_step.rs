//! A step on the device (forward, losses, backward of colours, Adam; nothing read back) against the
//! same step with the images and gradients taken to the host and back, as `cuar` does it over any
//! rasteriser. The adapter's name is printed first; on a software adapter the scene is small.
//!
//! `C4D_BENCH_ADAPTER=<index>` picks an adapter; the default is hardware if there is any, else
//! software.

#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a bench prints and stops at the first error"
)]

use criterion::{BenchmarkId, Criterion};
use cuar::loss::{LossWeights, Objective, Shape};
use gs_core::{Camera, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads};
use gs_raster_wgpu::{AdapterChoice, AdapterKind, GpuContext, GpuOptions, WgpuRasterizer};
use gs_train_wgpu::{ImageLosses, Rates, Targets, TrainOptions, Trainer, Weights};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::collections::BTreeMap;
use std::time::Duration;

/// Splats around the origin, degree-3 harmonics.
fn scene(num: usize) -> Splats {
    let mut rng = Pcg64Mcg::seed_from_u64(num as u64);
    let mut splats = Splats::with_capacity(num, 3);
    let mut bell = || (0..4).map(|_| rng.random_range(-0.5_f32..0.5)).sum::<f32>();
    for _ in 0..num {
        splats.means.push([0; 3].map(|_| 1.5 * bell()));
        splats.quats.push([0; 4].map(|_| bell()));
        splats.log_scales.push([0; 3].map(|_| -4.6 + 0.9 * bell()));
        splats.opacity_logits.push(1.0 + 3.0 * bell());
        splats.sh.extend((0..16).map(|_| [0.3 * bell(), 0.3 * bell(), 0.3 * bell()]));
    }
    splats
}

fn context(timestamps: bool) -> Option<GpuContext> {
    let options = GpuOptions { timestamps, ..GpuOptions::default() };
    let make = |choice| GpuContext::with_options(choice, options);
    let chosen = match std::env::var("C4D_BENCH_ADAPTER") {
        Ok(index) => make(AdapterChoice::Index(index.parse().unwrap_or(usize::MAX))),
        Err(_) => make(AdapterChoice::Auto).or_else(|_| make(AdapterChoice::Software)),
    };
    chosen.inspect_err(|error| println!("no bench: {error}")).ok()
}

fn bench(criterion: &mut Criterion, context: &GpuContext) {
    let hardware = context.adapter().kind == AdapterKind::Hardware;
    let (num, width, height) = if hardware { (1_000_000, 1352, 1014) } else { (5_000, 169, 127) };
    let pixels = (width * height) as usize;
    let raster = WgpuRasterizer::new(context.clone());
    let splats = scene(num);
    let camera = Camera::look_at([0.0, 0.0, -4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.8, width, height);
    let rates = Rates { sh_dc: 2.5e-3, sh_rest: 1.25e-4, ..Rates::default() };
    let losses = LossWeights::default();
    let weights = Weights::refinement(losses.eta, losses.zeta);
    let params = RenderParams { depth: false, ..RenderParams::default() };
    let options = TrainOptions { weights, rates, params };
    let warp: Vec<f32> = (0..3 * pixels).map(|k| (k % 251) as f32 / 251.0).collect();
    let fore: Vec<f32> = (0..pixels).map(|p| f32::from(u8::from(p % 3 > 0))).collect();
    let back: Vec<f32> = fore.iter().map(|m| 1.0 - m).collect();

    if let Some(context) = context.adapter().timestamps.then(|| self::context(true)).flatten() {
        let raster = WgpuRasterizer::new(context.clone());
        let mut trainer = Trainer::new(raster.clone(), 3, options, &[]).unwrap();
        let mut prepared = raster.prepare(&splats, &camera).unwrap();
        raster.upload_appearance(&mut prepared, &splats, &[], trainer.params()).unwrap();
        let mut targets = Targets::default();
        targets.upload(&context, [width, height], [&warp, &warp, &fore, &back]).unwrap();
        // The first step compiles.
        trainer.step(&mut prepared, &targets).unwrap();
        trainer.step(&mut prepared, &targets).unwrap();
        let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
        for timing in trainer.timings().unwrap() {
            *sums.entry(timing.name).or_default() += timing.nanoseconds * 1e-6;
        }
        println!("passes of a step with {num} splats, ms: {sums:.3?}");
    }
    let mut group = criterion.benchmark_group(format!("step, {width}x{height}"));
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    group.warm_up_time(Duration::from_secs(1));
    let mut trainer = Trainer::new(raster.clone(), 3, options, &[]).unwrap();
    let mut prepared = raster.prepare(&splats, &camera).unwrap();
    raster.upload_appearance(&mut prepared, &splats, &[], trainer.params()).unwrap();
    let mut targets = Targets::default();
    targets.upload(context, [width, height], [&warp, &warp, &fore, &back]).unwrap();
    group.bench_function(BenchmarkId::new("on the device", num), |bencher| {
        bencher.iter(|| {
            for _ in 0..4 {
                trainer.step(&mut prepared, &targets).unwrap();
            }
            // Waits for the device: work that was only recorded is not measured.
            trainer.losses().unwrap()
        });
    });

    let mut tuned = splats.clone();
    let (mut out, mut grads) = (RenderOutput::default(), RenderGrads::default());
    let mut objective =
        Objective::<f32>::new(width as usize, height as usize, pixels, LossWeights::default());
    let mut adam = cuar::Adam::<f32>::new(3 * splats.sh.len());
    let mut upstream = UpstreamGrads::default();
    let mut column_rates = vec![rates.sh_rest; 48];
    column_rates[..3].fill(rates.sh_dc);
    group.bench_function(BenchmarkId::new("through the host", num), |bencher| {
        bencher.iter(|| {
            for _ in 0..4 {
                raster.forward_into(&mut prepared, &tuned, &[], &params, &mut out).unwrap();
                let targets =
                    cuar::loss::Targets { original: &warp, warp: &warp, fore: &fore, back: &back };
                let v_rgb = &mut upstream.v_rgb;
                objective.evaluate(&out.rgb, &targets, Shape::Exact, v_rgb, None);
                raster
                    .backward_colors_into(
                        &mut prepared,
                        &tuned,
                        &[],
                        &params,
                        &upstream,
                        &mut grads,
                    )
                    .unwrap();
                let values = tuned.sh.as_flattened_mut();
                adam.step(values, grads.v_sh.as_flattened(), &column_rates, |_| false);
            }
        });
    });

    let mut losses = ImageLosses::new(context, [width, height], 3, 1).unwrap();
    for (what, ssim) in [("masked L1, host to host", false), ("SSIM, host to host", true)] {
        group.bench_function(what, |bencher| {
            bencher.iter(|| losses.evaluate(ssim, &out.rgb, &warp, &fore, 1e-6).unwrap());
        });
    }
    group.finish();
}

fn main() {
    let Some(context) = context(false) else { return };
    println!("adapter: {}; four steps are one iteration", context.adapter());
    let mut criterion = Criterion::default().configure_from_args();
    bench(&mut criterion, &context);
    criterion.final_summary();
}
