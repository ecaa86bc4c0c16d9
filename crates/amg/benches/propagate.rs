//! The whole stage, and one frame of its result, on synthetic scenes of known kind.

use amg::{MotionOptions, MotionPreset, propagate};
use criterion::{Criterion, criterion_group, criterion_main};
use gs_core::{DynamicScene, Splats};
use gs_synth::{TruthCase, build};
use std::sync::Arc;

fn scene(size: usize) -> (Arc<dyn DynamicScene>, Arc<Splats>) {
    let case: TruthCase = "everything".parse().expect("a case of gs-synth");
    let scene = build(case, 1, size).expect("large enough for every case");
    (Arc::new(scene.source), Arc::new(scene.edited.splats))
}

fn stage(criterion: &mut Criterion) {
    let (source, edited) = scene(6_000);
    let mut group = criterion.benchmark_group("propagate 6k");
    group.sample_size(10);
    for preset in [MotionPreset::Knn, MotionPreset::Paper, MotionPreset::Regions] {
        let options = MotionOptions::preset(preset);
        group.bench_function(format!("{preset:?}"), |bencher| {
            bencher.iter(|| {
                propagate(Arc::clone(&source), Arc::clone(&edited), &options, &|_, _| {})
                    .expect("a well-formed scene")
            });
        });
    }
    group.finish();
}

fn frame(criterion: &mut Criterion) {
    let (source, edited) = scene(18_000);
    let found = propagate(source, edited, &MotionOptions::default(), &|_, _| {})
        .expect("a well-formed scene");
    let mut group = criterion.benchmark_group("frame 18k");
    group.sample_size(10);
    let mut out = Splats::default();
    group.bench_function("geometry", |bencher| {
        bencher.iter(|| found.scene.geometry_into(0.7, &mut out).expect("inside the clip"));
    });
    group.finish();
}

criterion_group!(benches, stage, frame);
criterion_main!(benches);
