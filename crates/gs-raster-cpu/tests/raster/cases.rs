//! Golden cases as scenes.

use gs_core::{Camera, Intrinsics, Real, RenderParams, Splats, UpstreamGrads};
use test_support::fixture;
use test_support::golden::Golden;

pub(crate) const CASES: [&str; 8] = [
    "a_single",
    "b1_pair_front",
    "b2_pair_back",
    "b3_pair_tie",
    "c1_random200",
    "c2_random200_offcentre",
    "d_stress2000",
    "e_degenerate",
];

pub(crate) struct Case<F> {
    pub(crate) name: &'static str,
    pub(crate) golden: Golden,
    pub(crate) splats: Splats<F>,
    /// SH coefficients stored in the file, which may be more than the active degree uses.
    pub(crate) stored_coeffs: usize,
    pub(crate) features: Vec<F>,
    pub(crate) camera: Camera,
    pub(crate) params: RenderParams,
    pub(crate) upstream: UpstreamGrads<F>,
}

fn rows<F: Real, const N: usize>(values: &[f32]) -> Vec<[F; N]> {
    values.as_chunks::<N>().0.iter().map(|row| row.map(F::of)).collect()
}

fn cast<F: Real>(values: &[f32]) -> Vec<F> {
    values.iter().map(|&value| F::of(value)).collect()
}

impl<F: Real> Case<F> {
    pub(crate) fn open(name: &'static str) -> Self {
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

pub(crate) fn widen<F: Real>(values: &[F]) -> Vec<f64> {
    values.iter().map(|value| value.as_f64()).collect()
}

pub(crate) fn widen_rows<F: Real, const N: usize>(rows: &[[F; N]]) -> Vec<f64> {
    rows.iter().flatten().map(|value| value.as_f64()).collect()
}
