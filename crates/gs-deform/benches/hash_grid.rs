//! Swift4D networks with the two published table sizes and random weights, at one time: 100 000
//! dynamic Gaussians, alone and among 300 000 static ones.
//!
//! `all` evaluates all parameters, `geometry` skips colour and opacity,
//! `with_static` measures the cost of static Gaussians.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use gs_core::{DynamicScene, Splats};
use gs_deform::{
    Component, FieldBox, GridShape, HashGrid, HashGridField, HashGridNetwork, HashGridScene,
    IndexRule, Linear,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::hint::black_box;
use std::sync::Arc;

const DYNAMIC: usize = 100_000;
const STATIC: usize = 300_000;
const WIDTH: usize = 128;

fn values(rng: &mut Pcg64, count: usize, bound: f32) -> Vec<f32> {
    (0..count).map(|_| rng.random_range(-bound..bound)).collect()
}

fn linear(rng: &mut Pcg64, inputs: usize, outputs: usize) -> Linear {
    let bound = (6.0 / (inputs + outputs) as f32).sqrt();
    Linear { weight: values(rng, inputs * outputs, bound), bias: vec![0.0; outputs] }
}

fn field(log2_table: u32) -> HashGridField {
    let mut rng = Pcg64::seed_from_u64(17);
    let shape = GridShape { levels: 16, features: 4, log2_table, base: 16 };
    let table = values(&mut rng, shape.num_entries() * shape.features, 0.5);
    let heads = Component::ALL.map(|component| {
        [
            linear(&mut rng, WIDTH, WIDTH),
            linear(&mut rng, WIDTH, WIDTH),
            linear(&mut rng, WIDTH, component.num_outputs()),
        ]
    });
    HashGridField::new(HashGridNetwork {
        bounds: FieldBox { min: [-8.0; 3], max: [8.0; 3] },
        grid: HashGrid::new(shape, IndexRule::Current, table).expect("a table of this shape"),
        trunk: [linear(&mut rng, shape.num_features(), WIDTH), linear(&mut rng, WIDTH, WIDTH)],
        trunk_relu: true,
        heads,
    })
    .expect("a consistent network")
}

/// A figure of dynamic Gaussians in a room of static ones, in random order, as after densification.
fn scene(field: &Arc<HashGridField>, still: usize) -> HashGridScene {
    let mut rng = Pcg64::seed_from_u64(29);
    let n = DYNAMIC + still;
    let dynamic: Vec<bool> = (0..n).map(|_| rng.random_range(0..n) < DYNAMIC).collect();
    let means = dynamic.iter().map(|&dynamic| {
        let reach = if dynamic { 1.0 } else { 8.0 };
        std::array::from_fn(|_| rng.random_range(-reach..reach))
    });
    let canonical = Splats {
        means: means.collect(),
        quats: vec![[1.0, 0.0, 0.0, 0.0]; n],
        log_scales: vec![[-4.0; 3]; n],
        opacity_logits: vec![0.0; n],
        sh: vec![[0.0; 3]; n * 16],
        sh_degree: 3,
    };
    HashGridScene::new(canonical, dynamic, field.clone()).expect("SH degree 3")
}

fn deform(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("hash_grid");
    group.sample_size(10);
    for log2_table in [15, 19] {
        let field = Arc::new(field(log2_table));
        let mut out = Splats::default();
        let alone = scene(&field, 0);
        let name = format!("2^{log2_table}");
        group.bench_function(BenchmarkId::new("all", &name), |bench| {
            bench.iter(|| alone.at_into(black_box(0.37), &mut out));
        });
        group.bench_function(BenchmarkId::new("geometry", &name), |bench| {
            bench.iter(|| alone.geometry_into(black_box(0.37), &mut out));
        });
        let room = scene(&field, STATIC);
        group.bench_function(BenchmarkId::new("with_static", &name), |bench| {
            bench.iter(|| room.at_into(black_box(0.37), &mut out));
        });
    }
    group.finish();
}

criterion_group!(benches, deform);
criterion_main!(benches);
