//! Proves that the gradients of every parameter are those of the golden cases: both conventions,
//! every mode.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use common::{CASES, Case, MODES, Mode, raster, widen, widen_rows};
use gs_core::{GradientConvention, Rasterizer, RenderGrads, RenderParams, sh};
use test_support::compare::{assert_grad_close, relative_l2};

/// Gradient of the stored SH, zero above the active degree.
fn padded_sh(case: &Case, grads: &RenderGrads) -> Vec<f64> {
    let active = sh::num_coeffs(case.splats.sh_degree);
    let mut out = Vec::new();
    for row in grads.v_sh.chunks_exact(active) {
        out.extend(widen_rows(row));
        out.extend(std::iter::repeat_n(0.0, 3 * (case.stored_coeffs - active)));
    }
    out
}

/// Limit on both measures: relative L2, and largest error over largest entry.
fn limit(case: &str, tensor: &str) -> f64 {
    match (case.as_bytes()[0], tensor) {
        (b'c', _) => 5e-5,
        (b'd', "sh" | "features") => 2e-5,
        (b'd', "quats") => 2e-4,
        (b'd', "log_scales") => 5e-3,
        (b'd', _) => 1e-4,
        _ => 2e-5,
    }
}

fn gradients(mode: Mode, case: &Case, convention: GradientConvention) -> RenderGrads {
    let params = RenderParams { gradients: convention, ..case.params };
    let raster = raster(mode);
    let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
    raster.forward(&mut prepared, &case.splats, &case.features, &params).unwrap();
    raster.backward(&mut prepared, &case.splats, &case.features, &params, &case.upstream).unwrap()
}

fn check(prefix: &str, convention: GradientConvention, modes: &[Mode]) {
    for &mode in modes {
        for name in CASES {
            let case = Case::open(name);
            if !case.golden.has(&format!("{prefix}.means")) {
                assert_eq!(name, "e_degenerate", "only the degenerate case lacks exact gradients");
                continue;
            }
            let grads = gradients(mode, &case, convention);
            let tensors = [
                ("means", widen_rows(&grads.v_means)),
                ("log_scales", widen_rows(&grads.v_log_scales)),
                ("quats", widen_rows(&grads.v_quats)),
                ("opacity_logits", widen(&grads.v_opacity_logits)),
                ("sh", padded_sh(&case, &grads)),
                ("features", widen(&grads.v_features)),
                ("means2d_px", widen_rows(&grads.v_means2d)),
            ];
            for (tensor, ours) in tensors {
                let key = format!("{prefix}.{tensor}");
                if !case.golden.has(&key) {
                    assert_eq!(key, "grad_exact.means2d_px", "only this tensor may be absent");
                    continue;
                }
                let expected = case.golden.f64s(&key);
                if std::env::var_os("C4D_SHOW_ERRORS").is_some() {
                    eprintln!("{mode:?} {name} {key}: {:.2e}", relative_l2(&ours, &expected));
                }
                let what = format!("{mode:?} {name} {key}");
                assert_grad_close(&what, &ours, &expected, limit(name, tensor));
            }
        }
    }
}

/// Worst relative L2 seen on llvmpipe: see the crate's README.
#[test]
fn reference_gradients_match() {
    check("grad", GradientConvention::Reference, &MODES);
}

#[test]
fn exact_gradients_match() {
    check("grad_exact", GradientConvention::Exact, &[Mode::Portable, Mode::Native]);
}

/// Negative control: the stress case separates the conventions, so a comparison with the other one
/// must fail.
#[test]
fn conventions_differ_on_the_stress_case() {
    let case = Case::open("d_stress2000");
    let ours = widen_rows(&gradients(Mode::Portable, &case, GradientConvention::Exact).v_means);
    let error = relative_l2(&ours, &case.golden.f64s("grad.means"));
    assert!(error > 1e-4, "exact gradients pass for reference ones: {error:e}");
}

/// With geometry and opacity fixed, the single pass gives the same colour and feature gradients,
/// and nothing else.
#[test]
fn color_gradients_match_the_goldens() {
    for mode in MODES {
        for name in CASES {
            let case = Case::open(name);
            let raster = raster(mode);
            let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
            raster.forward(&mut prepared, &case.splats, &case.features, &case.params).unwrap();
            let grads = raster
                .backward_colors(
                    &mut prepared,
                    &case.splats,
                    &case.features,
                    &case.params,
                    &case.upstream,
                )
                .unwrap();
            let what = format!("{mode:?} {name}");
            let limit = if name.starts_with('c') { 5e-5 } else { 2e-5 };
            assert_grad_close(
                &what,
                &padded_sh(&case, &grads),
                &case.golden.f64s("grad.sh"),
                limit,
            );
            let features = widen(&grads.v_features);
            assert_grad_close(&what, &features, &case.golden.f64s("grad.features"), limit);
            assert!(
                grads.v_means.is_empty() && grads.v_opacity_logits.is_empty(),
                "{what}: only colours"
            );
        }
    }
}

/// Without float atomics the gradients are the same from run to run, to the bit.
#[test]
fn gradients_repeat_exactly_without_float_atomics() {
    let case = Case::open("c1_random200");
    for mode in [Mode::Portable, Mode::Deterministic, Mode::Tiny] {
        let first = gradients(mode, &case, GradientConvention::Reference);
        let second = gradients(mode, &case, GradientConvention::Reference);
        assert_eq!(first, second, "{mode:?}");
    }
}
