//! The stages and the total, for a figure-like cloud and the paper's 300 000 lines.

use std::hint::black_box;
use std::time::Duration;

use anchors::{AnchorParams, AnchorSet, BoundingSphere, KdTree, Lines, Neighborhoods, Radius};
use criterion::{Criterion, criterion_group, criterion_main};

#[path = "../tests/suite/scenes.rs"]
#[allow(dead_code, reason = "the tests use the rest")]
mod scenes;

fn whole(c: &mut Criterion) {
    let mut group = c.benchmark_group("anchor_set");
    group.sample_size(10).measurement_time(Duration::from_secs(2));
    for n in [5_000, 20_000, 100_000] {
        let points = scenes::figure(n, 1);
        let params = AnchorParams::default();
        group.bench_function(format!("{n}_points"), |b| {
            b.iter(|| AnchorSet::of(black_box(&points), &params));
        });
    }
    group.finish();
}

fn stages(c: &mut Criterion) {
    let points = scenes::figure(100_000, 1);
    let params = AnchorParams::default();
    let local = AnchorParams { radius: Radius::Local, ..params.clone() };
    let sphere = BoundingSphere::of(&points).expect("a valid cloud");
    let lines = Lines::sample(&sphere, params.num_lines, 0);
    let groups = Neighborhoods::build(&points, None, &params).expect("a valid cloud");
    let features = vec![anchors::normal_feature([0.0, 0.6, 0.8], 1.0); points.len()];

    let mut group = c.benchmark_group("stages_100k");
    group.sample_size(10).measurement_time(Duration::from_secs(1));
    group.bench_function("sphere", |b| b.iter(|| BoundingSphere::of(black_box(&points))));
    group.bench_function("lines", |b| b.iter(|| Lines::sample(&sphere, params.num_lines, 0)));
    group.bench_function("kd_tree", |b| b.iter(|| KdTree::new(black_box(&points))));
    group.bench_function("neighborhoods", |b| {
        b.iter(|| Neighborhoods::build(black_box(&points), None, &params));
    });
    group.bench_function("neighborhoods_joint", |b| {
        b.iter(|| Neighborhoods::build(black_box(&points), Some(&features), &params));
    });
    group.bench_function("cylinder_global", |b| {
        b.iter(|| AnchorSet::build(black_box(&points), &groups, &lines, &params));
    });
    group.bench_function("cylinder_local", |b| {
        b.iter(|| AnchorSet::build(black_box(&points), &groups, &lines, &local));
    });
    group.finish();
}

criterion_group!(benches, whole, stages);
criterion_main!(benches);
