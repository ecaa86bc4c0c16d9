//! Prepare, forward, backward and colour-only backward on realistic scenes, in evaluated
//! pixel–splat samples per second, next to the one-core roofline of the arithmetic.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use gs_core::{Rasterizer, RenderGrads, RenderOutput, RenderParams, UpstreamGrads};
use gs_raster_cpu::CpuRasterizer;
use std::hint::black_box;
use std::time::Duration;

#[path = "common/roofline.rs"]
mod roofline;
#[path = "common/scene.rs"]
mod scene;

fn bench(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("roofline");
    group.throughput(Throughput::Elements(roofline::SAMPLES));
    group.bench_function("one core", |b| b.iter(|| black_box(roofline::run())));
    group.finish();

    for (count, width, height) in scene::SIZES {
        let splats = scene::splats(count, 1);
        let camera = scene::camera(width, height);
        let pixels = (width * height) as usize;
        let raster = CpuRasterizer::default();
        let params = RenderParams::default();
        let upstream =
            UpstreamGrads { v_rgb: scene::upstream(3 * pixels), ..UpstreamGrads::default() };
        let (mut out, mut grads) = (RenderOutput::default(), RenderGrads::default());
        let Ok(mut prepared) = raster.prepare(&splats, &camera) else { continue };
        raster
            .forward_into(&mut prepared, &splats, &[], &params, &mut out)
            .unwrap_or_else(|error| panic!("{error}"));

        let mut group = criterion.benchmark_group(format!("{width}x{height}"));
        group.throughput(Throughput::Elements(prepared.num_evaluated()));
        group.bench_function(BenchmarkId::new("prepare", count), |b| {
            b.iter(|| raster.prepare_into(&splats, &camera, &mut prepared));
        });
        group.bench_function(BenchmarkId::new("forward", count), |b| {
            b.iter(|| raster.forward_into(&mut prepared, &splats, &[], &params, &mut out));
        });
        group.bench_function(BenchmarkId::new("backward", count), |b| {
            b.iter(|| {
                raster.backward_into(&mut prepared, &splats, &[], &params, &upstream, &mut grads)
            });
        });
        group.bench_function(BenchmarkId::new("backward_colors", count), |b| {
            b.iter(|| {
                raster.backward_colors_into(
                    &mut prepared,
                    &splats,
                    &[],
                    &params,
                    &upstream,
                    &mut grads,
                )
            });
        });
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800));
    targets = bench
}
criterion_main!(benches);
