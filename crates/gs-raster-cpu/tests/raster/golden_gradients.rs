//! The gradients of every parameter equal those of the golden cases,
//! in both conventions and both float types.

use gs_core::GradientConvention;
use gs_raster_cpu::CpuRasterizer;
use test_support::raster::{
    check_color_gradients, check_conventions_differ, check_gradients, single_precision_limit,
};

/// The stress case is stored in single precision. Worst seen 3.6e-8; others 1.1e-14.
fn double_precision_limit(case: &str, _tensor: &str) -> f64 {
    if case.starts_with('d') { 1e-7 } else { 3e-14 }
}

fn single(convention: GradientConvention) {
    let raster = CpuRasterizer::default();
    check_gradients::<f32, _>("f32", &raster, convention, single_precision_limit);
}

fn double(convention: GradientConvention) {
    let raster = CpuRasterizer::default();
    check_gradients::<f64, _>("f64", &raster, convention, double_precision_limit);
}

#[test]
fn reference_gradients_in_single_precision() {
    single(GradientConvention::Reference);
}

#[test]
fn reference_gradients_in_double_precision() {
    double(GradientConvention::Reference);
}

#[test]
fn exact_gradients_in_single_precision() {
    single(GradientConvention::Exact);
}

#[test]
fn exact_gradients_in_double_precision() {
    double(GradientConvention::Exact);
}

#[test]
fn conventions_differ_on_the_stress_case() {
    check_conventions_differ::<f64, _>(&CpuRasterizer::default());
}

#[test]
fn color_gradients_match_the_goldens() {
    check_color_gradients::<f32, _>("f32", &CpuRasterizer::default());
}
