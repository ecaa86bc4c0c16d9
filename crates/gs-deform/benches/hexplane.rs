//! Deformation of 100 000 Gaussians at one time by networks with random
//! weights in the three published configurations.
//!
//! `cached` is the cost of every frame after the first, `uncached` the cost of each frame if the
//! spatial features exceed the memory bound; `geometry` skips colour and opacity.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use gs_core::{DynamicScene, Splats};
use gs_deform::{
    Component, Head, Heads, HexPlane, HexPlaneField, HexPlaneNetwork, HexPlaneScene, Linear, Mask,
    Plane,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::hint::black_box;

const GAUSSIANS: usize = 100_000;

struct Config {
    name: &'static str,
    width: usize,
    channels: usize,
    multires: &'static [usize],
    time: usize,
    heads: usize,
}

const CONFIGS: [Config; 3] = [
    Config { name: "dnerf", width: 64, channels: 32, multires: &[1, 2], time: 50, heads: 3 },
    Config {
        name: "hypernerf",
        width: 128,
        channels: 16,
        multires: &[1, 2, 4],
        time: 150,
        heads: 3,
    },
    Config { name: "dynerf", width: 128, channels: 16, multires: &[1, 2], time: 150, heads: 5 },
];

fn values(rng: &mut Pcg64, count: usize, bound: f32) -> Vec<f32> {
    (0..count).map(|_| rng.random_range(-bound..bound)).collect()
}

fn linear(rng: &mut Pcg64, inputs: usize, outputs: usize) -> Linear {
    let bound = (6.0 / (inputs + outputs) as f32).sqrt();
    Linear { weight: values(rng, inputs * outputs, bound), bias: values(rng, outputs, 0.1) }
}

fn scene(config: &Config) -> HexPlaneScene {
    let mut rng = Pcg64::seed_from_u64(17);
    let levels = config.multires.iter().map(|&multiplier| {
        [false, false, true, false, true, true].map(|timed| {
            let columns = 64 * multiplier;
            let rows = if timed { config.time } else { columns };
            let texels = values(&mut rng, rows * columns * config.channels, 1.0);
            Plane { columns, rows, texels }
        })
    });
    let levels = levels.collect();
    let planes = HexPlane { aabb: [[1.6; 3], [-1.6; 3]], channels: config.channels, levels };
    let mut head = |component: Component| {
        let wanted = (component as usize) < config.heads;
        wanted.then(|| Head {
            hidden: linear(&mut rng, config.width, config.width),
            out: linear(&mut rng, config.width, component.num_outputs()),
        })
    };
    let heads = Heads {
        means: head(Component::Means),
        log_scales: head(Component::LogScales),
        quats: head(Component::Quats),
        opacity_logits: head(Component::OpacityLogits),
        sh: head(Component::Sh),
    };
    let trunk = vec![linear(&mut rng, planes.num_features(), config.width)];
    let network = HexPlaneNetwork {
        planes,
        trunk,
        heads,
        mask: Mask::One,
        grid_pe: 0,
        apply_rotation: false,
    };
    let row = |rng: &mut Pcg64| std::array::from_fn(|_| rng.random_range(-1.7..1.7));
    let canonical = Splats {
        means: (0..GAUSSIANS).map(|_| row(&mut rng)).collect(),
        quats: vec![[1.0, 0.0, 0.0, 0.0]; GAUSSIANS],
        log_scales: vec![[-4.0; 3]; GAUSSIANS],
        opacity_logits: vec![0.0; GAUSSIANS],
        sh: vec![[0.0; 3]; GAUSSIANS * 16],
        sh_degree: 3,
    };
    let field = HexPlaneField::new(network).expect("a consistent network");
    HexPlaneScene::new(canonical, field).expect("SH degree 3")
}

fn deform(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("hexplane");
    group.sample_size(10);
    for config in &CONFIGS {
        let mut out = Splats::default();
        let cached = scene(config);
        cached.at_into(0.0, &mut out).expect("inside the time range");
        group.bench_function(BenchmarkId::new("cached", config.name), |bench| {
            bench.iter(|| cached.at_into(black_box(0.37), &mut out));
        });
        group.bench_function(BenchmarkId::new("geometry", config.name), |bench| {
            bench.iter(|| cached.geometry_into(black_box(0.37), &mut out));
        });
        let uncached = cached.with_cache_limit(0);
        group.bench_function(BenchmarkId::new("uncached", config.name), |bench| {
            bench.iter(|| uncached.at_into(black_box(0.37), &mut out));
        });
    }
    group.finish();
}

criterion_group!(benches, deform);
criterion_main!(benches);
