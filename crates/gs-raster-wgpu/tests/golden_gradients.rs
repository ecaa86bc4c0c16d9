//! The gradients of every parameter equal those of the golden
//! cases, in both conventions and every mode.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use common::{MODES, Mode, raster};
use gs_core::GradientConvention;
use test_support::raster::{
    Case, check_color_gradients, check_conventions_differ, check_gradients, gradients,
    single_precision_limit,
};

fn check(mode: Mode, convention: GradientConvention) {
    check_gradients(&format!("{mode:?}"), &raster(mode), convention, single_precision_limit);
}

/// Worst relative L2 seen on llvmpipe: see the crate's README.
#[test]
fn reference_gradients_match() {
    for mode in MODES {
        check(mode, GradientConvention::Reference);
    }
}

#[test]
fn exact_gradients_match() {
    for mode in [Mode::Portable, Mode::Native] {
        check(mode, GradientConvention::Exact);
    }
}

#[test]
fn conventions_differ_on_the_stress_case() {
    check_conventions_differ(&raster(Mode::Portable));
}

#[test]
fn color_gradients_match_the_goldens() {
    for mode in MODES {
        check_color_gradients(&format!("{mode:?}"), &raster(mode));
    }
}

/// Without float atomics the gradients are bit-identical from run to run.
#[test]
fn gradients_repeat_exactly_without_float_atomics() {
    let case = Case::open("c1_random200");
    for mode in [Mode::Portable, Mode::Deterministic, Mode::Tiny] {
        let first = gradients(&raster(mode), &case, GradientConvention::Reference);
        let second = gradients(&raster(mode), &case, GradientConvention::Reference);
        assert_eq!(first, second, "{mode:?}");
    }
}
