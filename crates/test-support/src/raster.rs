//! Golden cases of the rasteriser, with the checks that every implementation of
//! [`gs_core::Rasterizer`] has to pass.

#![allow(clippy::unwrap_used, reason = "a check that cannot go on has failed")]

use crate::compare::{assert_grad_close, relative_l2, show_errors};
use crate::fixture::fixture;
use crate::golden::Golden;
use gs_core::{
    Camera, GradientConvention, Intrinsics, Rasterizer, Real, RenderGrads, RenderOutput,
    RenderParams, Splats, UpstreamGrads, sh,
};

/// Names of the cases: `fixtures/raster/NAME.safetensors`.
pub const CASES: [&str; 8] = [
    "a_single",
    "b1_pair_front",
    "b2_pair_back",
    "b3_pair_tie",
    "c1_random200",
    "c2_random200_offcentre",
    "d_stress2000",
    "e_degenerate",
];

/// A golden case.
#[derive(Debug)]
pub struct Case<F> {
    /// One of [`CASES`].
    pub name: &'static str,
    /// Expected values, by tensor name.
    pub golden: Golden,
    /// Input, cut to the active SH degree.
    pub splats: Splats<F>,
    /// SH coefficients stored in the file, which may be more than the active degree uses.
    pub stored_coeffs: usize,
    /// Features per splat, row-major.
    pub features: Vec<F>,
    /// View.
    pub camera: Camera,
    /// Background of the case, otherwise defaults.
    pub params: RenderParams,
    /// Gradients of the loss by the output planes.
    pub upstream: UpstreamGrads<F>,
}

fn rows<F: Real, const N: usize>(values: &[f32]) -> Vec<[F; N]> {
    values.as_chunks::<N>().0.iter().map(|row| row.map(F::of)).collect()
}

fn cast<F: Real>(values: &[f32]) -> Vec<F> {
    values.iter().map(|&value| F::of(value)).collect()
}

impl<F: Real> Case<F> {
    /// Reads a case.
    ///
    /// # Panics
    /// If the file is missing or malformed.
    pub fn open(name: &'static str) -> Self {
        let golden = Golden::open(fixture(&format!("raster/{name}.safetensors")));
        let sizes = golden.i32s("cam.size");
        let (width, height) = (sizes[0].unsigned_abs(), sizes[1].unsigned_abs());
        let view = golden.f64s("cam.viewmat");
        let k = golden.f64s("cam.intrinsics");
        let background = golden.f64s("cam.background");
        let camera = Camera {
            viewmat: [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| view[4 * i + j])),
            intrinsics: Intrinsics { fx: k[0], fy: k[1], cx: k[2], cy: k[3] },
            width,
            height,
            near: gs_core::image_formation::NEAR_PLANE,
            time: None,
            name: name.to_owned(),
        };
        let stored_coeffs = golden.shape("in.sh")[1];
        let stored = Splats::<F> {
            means: rows(&golden.f32s("in.means")),
            quats: rows(&golden.f32s("in.quats")),
            log_scales: rows(&golden.f32s("in.log_scales")),
            opacity_logits: cast(&golden.f32s("in.opacity_logits")),
            sh: rows(&golden.f32s("in.sh")),
            sh_degree: gs_core::sh::degree_of(stored_coeffs).unwrap(),
        };
        let degree = usize::try_from(golden.i32s("cam.sh_degree")[0]).unwrap();
        Self {
            name,
            splats: stored.with_sh_degree(degree),
            stored_coeffs,
            features: cast(&golden.f32s("in.features")),
            camera,
            params: RenderParams {
                background: [background[0], background[1], background[2]],
                ..RenderParams::default()
            },
            upstream: UpstreamGrads {
                v_rgb: cast(&golden.f32s("up.rgb")),
                v_alpha: cast(&golden.f32s("up.alpha")),
                v_depth: cast(&golden.f32s("up.depth")),
                v_features: cast(&golden.f32s("up.features")),
            },
            golden,
        }
    }
}

/// Widens to `f64` for the comparators.
pub fn widen<F: Real>(values: &[F]) -> Vec<f64> {
    values.iter().map(|value| value.as_f64()).collect()
}

/// Widens rows to `f64`, row-major.
pub fn widen_rows<F: Real, const N: usize>(rows: &[[F; N]]) -> Vec<f64> {
    rows.iter().flatten().map(|value| value.as_f64()).collect()
}

/// Largest error of a plane on pixels whose decisions (1/255, early stop, order) are clear, and on
/// the others.
///
/// # Panics
/// If the lengths differ.
pub fn image_errors<F: Real>(case: &Case<F>, plane: &str, actual: &[F]) -> (f64, f64) {
    let expected = case.golden.f64s(&format!("out.{plane}"));
    assert_eq!(actual.len(), expected.len(), "{} {plane}: length", case.name);
    let ambiguous = case.golden.u8s("out.ambiguous");
    let channels = expected.len() / ambiguous.len();
    let mut worst = (0.0_f64, 0.0_f64);
    for (i, (a, e)) in widen(actual).iter().zip(&expected).enumerate() {
        let error = (a - e).abs();
        let error = if error.is_nan() { f64::INFINITY } else { error };
        if ambiguous[i / channels] == 0 {
            worst.0 = worst.0.max(error);
        } else {
            worst.1 = worst.1.max(error);
        }
    }
    show_errors(
        &format!("{} {plane}", case.name),
        format_args!("{:.1e}, borderline {:.1e}", worst.0, worst.1),
    );
    worst
}

/// Compares every plane of an image in single precision with the case. Borderline pixels may
/// differ by 0.5 % of the largest feature: there one splat more or less is blended, with an alpha
/// of 1/255. `fixtures/raster/README.md` has the worst errors seen, a third to a half of the
/// limits.
///
/// # Panics
/// If a plane differs.
pub fn check_images<F: Real>(what: &str, case: &Case<F>, out: &RenderOutput<F>) {
    let finite = case.features.iter().map(|feature| feature.as_f64()).filter(|f| f.is_finite());
    let largest = finite.fold(1.0_f64, |largest, feature| largest.max(feature.abs()));
    for (plane, values, limit) in [
        ("rgb", &out.rgb, 7e-6),
        ("alpha", &out.alpha, 7e-6),
        ("depth", &out.depth, 1.5e-5),
        ("features", &out.features, 1.5e-5),
    ] {
        let (clear, borderline) = image_errors(case, plane, values);
        assert!(clear <= limit, "{what} {} {plane}: {clear:e} exceeds {limit:e}", case.name);
        let limit = 0.005 * largest;
        assert!(borderline <= limit, "{what} {} {plane}, borderline: {borderline:e}", case.name);
    }
}

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

/// Limit of single precision on both measures of [`assert_grad_close`], two to three times the
/// worst error seen with both rasterisers, which is next to each. The stress case has very thin
/// splats, whose gradients cancel.
pub fn single_precision_limit(case: &str, tensor: &str) -> f64 {
    match (case.as_bytes()[0], tensor) {
        (b'c' | b'd', "sh" | "features" | "opacity_logits") => 3e-6, // 1.2e-6
        (b'c', _) => 2e-5,                                           // 8.6e-6, quats
        (b'd', "quats") => 4e-5,                                     // 1.6e-5
        (b'd', "log_scales") => 8e-4,                                // 2.9e-4
        (b'd', _) => 1.2e-5,                                         // 4.6e-6
        _ => 6e-6,                                                   // 2.1e-6, centres
    }
}

/// Prefix of the golden tensors of a convention.
fn prefix(convention: GradientConvention) -> &'static str {
    match convention {
        GradientConvention::Exact => "grad_exact",
        GradientConvention::Reference => "grad",
    }
}

/// Gradients of a case by one forward and one backward pass.
///
/// # Panics
/// If the rasteriser fails.
pub fn gradients<F: Real, R: Rasterizer<F>>(
    raster: &R,
    case: &Case<F>,
    convention: GradientConvention,
) -> RenderGrads<F> {
    let params = RenderParams { gradients: convention, ..case.params };
    let mut prepared = raster.prepare(&case.splats, &case.camera).unwrap();
    raster.forward(&mut prepared, &case.splats, &case.features, &params).unwrap();
    raster.backward(&mut prepared, &case.splats, &case.features, &params, &case.upstream).unwrap()
}

/// Compares the gradients of every parameter with those of every case.
///
/// # Panics
/// If one differs by more than `limit(case, tensor)`.
pub fn check_gradients<F: Real, R: Rasterizer<F>>(
    what: &str,
    raster: &R,
    convention: GradientConvention,
    limit: impl Fn(&str, &str) -> f64,
) {
    let prefix = prefix(convention);
    for name in CASES {
        let case = Case::open(name);
        if !case.golden.has(&format!("{prefix}.means")) {
            assert_eq!(name, "e_degenerate", "only the degenerate case lacks exact gradients");
            continue;
        }
        let grads = gradients(raster, &case, convention);
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
            let what = format!("{what} {name} {key}");
            assert_grad_close(&what, &ours, &expected, limit(name, tensor));
        }
    }
}

/// With geometry and opacity fixed, the single pass gives the golden gradients of colours and
/// features, and no others.
///
/// # Panics
/// If it does not.
pub fn check_color_gradients<F: Real, R: Rasterizer<F>>(what: &str, raster: &R) {
    for name in CASES {
        let case = Case::open(name);
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
        let limit = single_precision_limit(name, "sh");
        let expected = case.golden.f64s("grad.sh");
        let what = format!("{what} {name} colours only");
        assert_grad_close(&what, &padded_sh(&case, &grads), &expected, limit);
        let expected = case.golden.f64s("grad.features");
        assert_grad_close(&what, &widen(&grads.v_features), &expected, limit);
        assert!(
            grads.v_means.is_empty() && grads.v_opacity_logits.is_empty(),
            "{what}: only colours"
        );
    }
}

/// Negative control: the stress case separates the conventions, so a comparison of exact gradients
/// with the reference's must fail.
///
/// # Panics
/// If they agree.
pub fn check_conventions_differ<F: Real, R: Rasterizer<F>>(raster: &R) {
    let case = Case::open("d_stress2000");
    let ours = widen_rows(&gradients(raster, &case, GradientConvention::Exact).v_means);
    let error = relative_l2(&ours, &case.golden.f64s("grad.means"));
    assert!(error > 1e-4, "exact gradients pass for reference ones: {error:e}");
}
