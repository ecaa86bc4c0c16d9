//! Cost of the loss, of making one supervised image, and of one evaluation of an image.

use criterion::{Criterion, criterion_group, criterion_main};
use cuar::loss::{L1Shape, LossWeights, Objective, Targets};
use cuar::{NoRefineObserver, RefineOptions, RegressionParams, Solver, Views, refine};
use gs_core::TimeRange;
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, demo};
use std::hint::black_box;

/// Seeded values in [0,1).
fn noise(len: usize, seed: u32) -> Vec<f32> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1_u32 << 24) as f32
    };
    (0..len).map(|_| next()).collect()
}

fn objective(c: &mut Criterion) {
    let (w, h) = (320, 240);
    let [render, original, warp] = [1, 2, 3].map(|seed| noise(w * h * 3, seed));
    let fore: Vec<f32> = (0..w * h).map(|p| f32::from(u8::from(p % w < w / 2))).collect();
    let back: Vec<f32> = fore.iter().map(|m| 1.0 - m).collect();
    let targets = Targets { original: &original, warp: &warp, fore: &fore, back: &back };
    let mut objective = Objective::new(w, h, w * h, LossWeights::default());
    let (mut gradient, mut curvature) = (Vec::new(), Vec::new());
    c.bench_function("loss, gradient and curvature 320x240", |b| {
        b.iter(|| {
            let smooth = L1Shape::Smooth(0.01);
            let bent = Some(&mut curvature);
            black_box(objective.evaluate(&render, &targets, smooth, &mut gradient, bent))
        });
    });
}

fn stage(c: &mut Criterion) {
    let params = DemoParams { num_splats: 6_000, sh_degree: 2, ..DemoParams::default() };
    let mut scene = demo(&params).expect("parameters in range");
    let edited = scene.moving_mask();
    scene = scene.noise_free();
    let cameras = scene.orbit_cameras(6, 160, 120);
    let times = TimeRange::UNIT.frames(9);
    let views = Views { cameras: &cameras, times: &times, held_out: &[] };
    for (name, passes) in [("make 20 images", 0), ("make 20 images and evaluate each twice", 2)] {
        let solver = Solver::Regression(RegressionParams { passes, ..RegressionParams::default() });
        let options = RefineOptions {
            samples: 20,
            solver,
            min_uncertainty: 0.0,
            keep_first_frame: false,
            ..RefineOptions::default()
        };
        c.bench_function(name, |b| {
            b.iter(|| {
                let raster = CpuRasterizer::default();
                let none = &mut NoRefineObserver;
                refine(&raster, &scene, &edited, &views, &options, None, none).expect("refines")
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = objective, stage
}
criterion_main!(benches);
