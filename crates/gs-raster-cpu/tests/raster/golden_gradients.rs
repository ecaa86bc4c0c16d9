//! Proves that the gradients of every parameter are those of the golden cases: both conventions,
//! both float types.

use crate::cases::{CASES, Case, widen, widen_rows};
use gs_core::{GradientConvention, Rasterizer, Real, RenderGrads, RenderParams, sh};
use gs_raster_cpu::{CpuRasterizer, Prepared};
use test_support::compare::{assert_grad_close, relative_l2};

/// Gradient of the stored SH, zero above the active degree.
fn padded_sh<F: Real>(case: &Case<F>, grads: &RenderGrads<F>) -> Vec<f64> {
    let active = sh::num_coeffs(case.splats.sh_degree);
    let mut out = Vec::new();
    for row in grads.v_sh.chunks_exact(active) {
        out.extend(widen_rows(row));
        out.extend(std::iter::repeat_n(0.0, 3 * (case.stored_coeffs - active)));
    }
    out
}

/// Limit on both measures: relative L2, and largest error over largest entry.
fn limit(case: &str, tensor: &str, double: bool) -> f64 {
    match (case.as_bytes()[0], double) {
        (b'd', true) => 1e-7,
        (_, true) => 1e-11,
        (b'c', false) => 5e-5,
        (b'd', false) => match tensor {
            "sh" | "features" => 2e-5,
            "quats" => 2e-4,
            "log_scales" => 5e-3,
            _ => 1e-4,
        },
        _ => 2e-5,
    }
}

fn gradients<F: Real>(case: &Case<F>, convention: GradientConvention) -> RenderGrads<F>
where
    CpuRasterizer: Rasterizer<F, Prepared = Prepared<F>>,
{
    let params = RenderParams { gradients: convention, ..case.params };
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
    raster.forward(&mut prepared, &case.splats, &case.features, &params).unwrap();
    raster.backward(&mut prepared, &case.splats, &case.features, &params, &case.upstream).unwrap()
}

fn check<F: Real>(prefix: &str, convention: GradientConvention, double: bool)
where
    CpuRasterizer: Rasterizer<F, Prepared = Prepared<F>>,
{
    for name in CASES {
        let case = Case::<F>::open(name);
        if !case.golden.has(&format!("{prefix}.means")) {
            assert_eq!(name, "e_degenerate", "only the degenerate case lacks exact gradients");
            continue;
        }
        let grads = gradients(&case, convention);
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
            if prefix == "grad_exact" && tensor == "means2d_px" {
                continue;
            }
            let expected = case.golden.f64s(&key);
            assert_grad_close(
                &format!("{name} {key}"),
                &ours,
                &expected,
                limit(name, tensor, double),
            );
        }
    }
}

#[test]
fn reference_gradients_in_single_precision() {
    check::<f32>("grad", GradientConvention::Reference, false);
}

#[test]
fn reference_gradients_in_double_precision() {
    check::<f64>("grad", GradientConvention::Reference, true);
}

#[test]
fn exact_gradients_in_single_precision() {
    check::<f32>("grad_exact", GradientConvention::Exact, false);
}

#[test]
fn exact_gradients_in_double_precision() {
    check::<f64>("grad_exact", GradientConvention::Exact, true);
}

/// Negative control: the stress case separates the conventions, so a comparison with the other one
/// must fail.
#[test]
fn conventions_differ_on_the_stress_case() {
    let case = Case::<f64>::open("d_stress2000");
    let ours = widen_rows(&gradients(&case, GradientConvention::Exact).v_means);
    let error = relative_l2(&ours, &case.golden.f64s("grad.means"));
    assert!(error > 1e-4, "exact gradients pass for reference ones: {error:e}");
}

/// With geometry and opacity fixed the single-pass backward gives the same colour and feature
/// gradients, and nothing else.
#[test]
fn color_gradients_match_the_full_backward() {
    for name in CASES {
        let case = Case::<f32>::open(name);
        let full = gradients(&case, GradientConvention::Reference);
        let raster = CpuRasterizer::default();
        let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
        raster.forward(&mut prepared, &case.splats, &case.features, &case.params).unwrap();
        let colors = raster
            .backward_colors(
                &mut prepared,
                &case.splats,
                &case.features,
                &case.params,
                &case.upstream,
            )
            .unwrap();
        assert_grad_close(name, &widen_rows(&colors.v_sh), &widen_rows(&full.v_sh), 2e-5);
        assert_grad_close(name, &widen(&colors.v_features), &widen(&full.v_features), 2e-5);
        assert!(colors.v_means.is_empty() && colors.v_opacity_logits.is_empty(), "{name}");
    }
}
