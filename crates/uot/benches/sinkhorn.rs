//! Median, structured and dense solves on an articulated figure before and after an edit.
//!
//! For the large sizes run the example `large_clouds`.

#[path = "../examples/figure/mod.rs"]
mod figure;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use figure::figure;
use std::hint::black_box;
use std::time::Duration;
use uot::{MedianMode, SinkhornParams, Storage, UotProblem, WelschParams, median_distance, solve};

fn median(c: &mut Criterion) {
    let mut group = c.benchmark_group("median_distance");
    for n in [1_000, 10_000] {
        let (src, edit) = (figure(n, 1, 0.0), figure(n, 2, 0.02));
        group.bench_function(BenchmarkId::from_parameter(n), |b| {
            b.iter(|| median_distance(black_box(&src), black_box(&edit), MedianMode::Exact));
        });
    }
    group.finish();
}

fn structured(c: &mut Criterion) {
    let mut group = c.benchmark_group("structured");
    for (n, cutoff, storage) in [
        (1_000, 6.0, Storage::F64),
        (3_000, 4.0, Storage::F32),
        (3_000, 6.0, Storage::F64),
        (10_000, 6.0, Storage::F64),
    ] {
        let (src, edit) = (figure(n, 1, 0.0), figure(n, 2, 0.02));
        let params = WelschParams { cutoff, storage, ..WelschParams::default() };
        let name = format!("{n}_cutoff_{cutoff}_{storage:?}");
        group.bench_function(name, |b| {
            b.iter(|| {
                let problem = UotProblem::welsch(black_box(&src), &edit, &params)?;
                let out = solve(&problem, &SinkhornParams::default())?;
                out.correspondence(&problem)
            });
        });
    }
    group.finish();
}

fn dense(c: &mut Criterion) {
    let mut group = c.benchmark_group("dense");
    let (src, edit) = (figure(1_000, 1, 0.0), figure(1_000, 2, 0.02));
    let problem = UotProblem::welsch_dense(&src, &edit, &WelschParams::default());
    let problem = problem.expect("a valid problem");
    for (name, lambda_ent, max_sweeps) in [("kernel", 0.1, 20_000), ("log_20_sweeps", 0.004, 20)] {
        let params = SinkhornParams { lambda_ent, max_sweeps, ..SinkhornParams::default() };
        group.bench_function(name, |b| b.iter(|| solve(black_box(&problem), &params)));
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2));
    targets = median, structured, dense
}
criterion_main!(benches);
