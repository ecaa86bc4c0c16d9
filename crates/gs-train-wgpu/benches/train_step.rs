//! A step of the refinement on the device (colours, forward, losses, backward, Adam; nothing read
//! back) against the same step with images and gradients copied to the host and back, as `cuar`
//! does it over any rasteriser. The adapter's name is printed first; on a software adapter the
//! scene is small.
//!
//! `C4D_BENCH_ADAPTER=<index>` selects an adapter; the default is hardware if available, else
//! software.

#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a bench prints and stops at the first error"
)]

use criterion::{BenchmarkId, Criterion};
use cuar::loss::{L1Shape, LossWeights, Objective};
use cuar::{Crop, DescentEngine, DescentImage, DescentTask, Entry};
use gs_core::{Camera, Rasterizer, RenderGrads, RenderOutput, RenderParams, Splats, UpstreamGrads};
use gs_raster_wgpu::{AdapterChoice, AdapterKind, GpuContext, GpuOptions, WgpuRasterizer};
use gs_train_wgpu::{DeviceDescent, ImageLosses};
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

/// Every splat, seen from the camera.
fn entries(splats: &Splats, camera: &Camera) -> Vec<Entry> {
    let eye = camera.position();
    #[expect(clippy::cast_possible_truncation, reason = "a direction in single precision")]
    let entry = |(row, mean): (u32, &[f32; 3])| {
        let ray = [0, 1, 2].map(|axis| f64::from(mean[axis]) - eye[axis]);
        let length = ray.iter().map(|x| x * x).sum::<f64>().sqrt();
        let towards = ray.map(|x| (x / length) as f32);
        Entry { local: row, row, towards, color: [0.5; 3], is_constrained: true }
    };
    (0..).zip(&splats.means).map(entry).collect()
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

fn bench(criterion: &mut Criterion, context: &GpuContext) {
    let hardware = context.adapter().kind == AdapterKind::Hardware;
    let (num, width, height) = if hardware { (1_000_000, 1352, 1014) } else { (5_000, 169, 127) };
    let pixels = (width * height) as usize;
    let raster = WgpuRasterizer::new(context.clone());
    let splats = scene(num);
    let camera = Camera::look_at([0.0, 0.0, -4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.8, width, height);
    let (dc, rest) = (2.5e-3, 1.25e-4);
    let mut rates = vec![rest; 48];
    rates[..3].fill(dc);
    let weights = LossWeights::default();
    let params = RenderParams { depth: false, ..RenderParams::default() };
    let warp: Vec<f32> = (0..3 * pixels).map(|k| (k % 251) as f32 / 251.0).collect();
    let fore: Vec<f32> = (0..pixels).map(|p| f32::from(u8::from(p % 3 > 0))).collect();
    let back: Vec<f32> = fore.iter().map(|m| 1.0 - m).collect();

    let flag = |m: &f32| {
        DescentImage::LIVE | if *m > 0.0 { DescentImage::FORE } else { DescentImage::BACK }
    };
    let flags: Vec<u8> = fore.iter().map(flag).collect();
    let entries = entries(&splats, &camera);
    let (side, original) = ([width, height].map(|side| side as usize), &warp[..]);
    let crop = Crop { x: 0, y: 0, width: side[0], height: side[1] };
    let (flags, entries) = (&flags[..], &entries[..]);
    let warp_rgb = original;
    let image =
        DescentImage { index: 0, size: side, crop, original, warp: warp_rgb, flags, entries };
    let offsets = vec![[0.0; 3]; splats.sh.len()];
    let task = DescentTask { sh_degree: 3, rates: &rates, weights, memory: usize::MAX };
    let engine = |raster: &WgpuRasterizer| {
        let mut engine = DeviceDescent::new(raster.clone()).unwrap();
        engine.begin(&task, &offsets, &cuar::Adam::new(3 * offsets.len())).unwrap();
        engine
    };
    if let Some(context) = context.adapter().timestamps.then(|| self::context(true)).flatten() {
        let raster = WgpuRasterizer::new(context);
        let (mut engine, mut prepared) =
            (engine(&raster), raster.prepare(&splats, &camera).unwrap());
        // The first step compiles.
        engine.step(&image, &mut prepared).unwrap();
        engine.step(&image, &mut prepared).unwrap();
        let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
        for timing in engine.timings().unwrap() {
            *sums.entry(timing.name).or_default() += timing.nanoseconds * 1e-6;
        }
        println!("passes of a step with {num} splats, ms: {sums:.3?}");
    }
    let mut group = criterion.benchmark_group(format!("step, {width}x{height}"));
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    group.warm_up_time(Duration::from_secs(1));
    let (mut engine, mut prepared) = (engine(&raster), raster.prepare(&splats, &camera).unwrap());
    group.bench_function(BenchmarkId::new("on the device", num), |bencher| {
        bencher.iter(|| {
            for _ in 0..4 {
                engine.step(&image, &mut prepared).unwrap();
            }
            // Waits for the device: work that was only recorded is not measured.
            engine.losses().unwrap()
        });
    });

    let mut prepared = raster.prepare(&splats, &camera).unwrap();
    let mut tuned = splats.clone();
    let (mut out, mut grads) = (RenderOutput::default(), RenderGrads::default());
    let mut objective = Objective::<f32>::new(width as usize, height as usize, pixels, weights);
    let mut adam = cuar::Adam::<f32>::new(3 * splats.sh.len());
    let mut upstream = UpstreamGrads::default();
    group.bench_function(BenchmarkId::new("through the host", num), |bencher| {
        bencher.iter(|| {
            for _ in 0..4 {
                raster.forward_into(&mut prepared, &tuned, &[], &params, &mut out).unwrap();
                let targets =
                    cuar::loss::Targets { original: &warp, warp: &warp, fore: &fore, back: &back };
                let v_rgb = &mut upstream.v_rgb;
                objective.evaluate(&out.rgb, &targets, L1Shape::Exact, v_rgb, None);
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
                let rows = (0..values.len() / rates.len()).map(|row| [row, row]);
                adam.step(values, grads.v_sh.as_flattened(), &rates, rows);
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
