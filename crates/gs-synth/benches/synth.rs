//! Generation, editing and evaluation of scenes.

use criterion::{Criterion, criterion_group, criterion_main};
use gs_core::{DynamicScene, Splats};
use gs_synth::{DemoParams, TruthCase, apply_edits, build, demo, demo_edits};
use std::hint::black_box;

fn synth(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("synth");
    group.sample_size(10);
    let params = DemoParams::default();
    group.bench_function("demo_30k", |b| b.iter(|| demo(black_box(&params))));
    let scene = demo(&params).expect("default parameters are valid");
    let edits = demo_edits();
    group.bench_function("edit_30k", |b| b.iter(|| apply_edits(&scene, black_box(&edits), 0)));
    let large = demo(&DemoParams { num_splats: 100_000, ..params }).expect("valid size");
    let mut out = Splats::default();
    group.bench_function("at_into_100k", |b| {
        b.iter(|| large.at_into(black_box(0.4), &mut out));
    });
    group.bench_function("case_everything_20k", |b| {
        b.iter(|| build(TruthCase::Everything, 0, black_box(20_000)));
    });
    group.finish();
}

criterion_group!(benches, synth);
criterion_main!(benches);
