//! One device per test binary and mode, golden cases and scenes.

#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part")]

use gs_core::{Camera, Intrinsics, RenderParams, Splats, UpstreamGrads};
use gs_raster_wgpu::{AdapterChoice, GpuContext, GpuOptions, WgpuRasterizer};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::OnceLock;
use test_support::fixture;
use test_support::golden::Golden;

/// Ways to use the same adapter; every test of the image and the gradients runs in several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Core WGSL, default limits.
    Portable,
    /// Everything the adapter has, but no float atomics.
    Deterministic,
    /// Everything the adapter has.
    Native,
    /// Core WGSL with bindings so small that harmonics and gradients of pairs are split.
    Tiny,
}

pub const MODES: [Mode; 4] = [Mode::Portable, Mode::Deterministic, Mode::Native, Mode::Tiny];

/// The adapter named by `C4D_TEST_ADAPTER` (`auto` or an index), by default a software one. No
/// adapter fails the test.
pub fn choice() -> AdapterChoice {
    match std::env::var("C4D_TEST_ADAPTER").as_deref() {
        Ok("auto") => AdapterChoice::Auto,
        Ok(index) => {
            AdapterChoice::Index(index.parse().expect("C4D_TEST_ADAPTER: auto or an index"))
        }
        Err(_) => AdapterChoice::Software,
    }
}

pub fn raster(mode: Mode) -> WgpuRasterizer {
    static CONTEXTS: [OnceLock<GpuContext>; 4] = [const { OnceLock::new() }; 4];
    let context = CONTEXTS[mode as usize].get_or_init(|| {
        let options = GpuOptions {
            portable: matches!(mode, Mode::Portable | Mode::Tiny),
            deterministic: mode == Mode::Deterministic,
            max_binding_bytes: (mode == Mode::Tiny).then_some(640 << 10),
            timestamps: mode == Mode::Native,
        };
        GpuContext::with_options(choice(), options).unwrap_or_else(|error| panic!("{error}"))
    });
    WgpuRasterizer::new(context.clone())
}

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

pub struct Case {
    pub name: &'static str,
    pub golden: Golden,
    pub splats: Splats,
    /// SH coefficients stored in the file, which may be more than the active degree uses.
    pub stored_coeffs: usize,
    pub features: Vec<f32>,
    pub camera: Camera,
    pub params: RenderParams,
    pub upstream: UpstreamGrads,
}

fn rows<const N: usize>(values: &[f32]) -> Vec<[f32; N]> {
    values.as_chunks::<N>().0.to_vec()
}

impl Case {
    pub fn open(name: &'static str) -> Self {
        let golden = Golden::open(fixture(&format!("raster/{name}.safetensors")));
        let sizes = golden.i32s("cam.size");
        let view = golden.f64s("cam.viewmat");
        let k = golden.f64s("cam.intrinsics");
        let background = golden.f64s("cam.background");
        let camera = Camera {
            viewmat: [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| view[4 * i + j])),
            intrinsics: Intrinsics { fx: k[0], fy: k[1], cx: k[2], cy: k[3] },
            width: sizes[0].unsigned_abs(),
            height: sizes[1].unsigned_abs(),
            near: gs_core::image_formation::NEAR_PLANE,
            time: None,
            name: name.to_owned(),
        };
        let stored_coeffs = golden.shape("in.sh")[1];
        let stored = Splats {
            means: rows(&golden.f32s("in.means")),
            quats: rows(&golden.f32s("in.quats")),
            log_scales: rows(&golden.f32s("in.log_scales")),
            opacity_logits: golden.f32s("in.opacity_logits"),
            sh: rows(&golden.f32s("in.sh")),
            sh_degree: gs_core::sh::degree_of(stored_coeffs).unwrap(),
        };
        let degree = usize::try_from(golden.i32s("cam.sh_degree")[0]).unwrap();
        Self {
            name,
            splats: stored.with_sh_degree(degree),
            stored_coeffs,
            features: golden.f32s("in.features"),
            camera,
            params: RenderParams {
                background: [background[0], background[1], background[2]],
                ..RenderParams::default()
            },
            upstream: UpstreamGrads {
                v_rgb: golden.f32s("up.rgb"),
                v_alpha: golden.f32s("up.alpha"),
                v_depth: golden.f32s("up.depth"),
                v_features: golden.f32s("up.features"),
            },
            golden,
        }
    }
}

pub fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&value| f64::from(value)).collect()
}

pub fn widen_rows<const N: usize>(rows: &[[f32; N]]) -> Vec<f64> {
    rows.iter().flatten().map(|&value| f64::from(value)).collect()
}

/// A scene with a camera that sees it.
pub struct Scene {
    pub name: &'static str,
    pub splats: Splats,
    pub camera: Camera,
}

pub fn camera(width: u32, height: u32) -> Camera {
    Camera::look_at([0.3, 0.2, -4.0], [0.0; 3], [0.0, 1.0, 0.1], 0.8, width, height)
}

/// Splats around the origin: clustered means, log-normal scales, all orientations.
pub fn cloud(seed: u64, num: usize, sh_degree: usize, log_scale: f32) -> Splats {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut splats = Splats::with_capacity(num, sh_degree);
    let mut symmetric = |reach: f32| rng.random_range(-reach..reach);
    for _ in 0..num {
        let spread = 0.4 + 0.6 * symmetric(1.0).abs();
        splats.means.push([0; 3].map(|_| spread * (symmetric(1.0) + symmetric(0.5))));
        splats.quats.push([0; 4].map(|_| symmetric(1.0)));
        splats.log_scales.push([0; 3].map(|_| log_scale + symmetric(0.8)));
        splats.opacity_logits.push(symmetric(3.0));
        for k in 0..splats.sh_coeffs() {
            let reach = if k == 0 { 1.5 } else { 0.3 };
            splats.sh.push([0; 3].map(|_| symmetric(reach)));
        }
    }
    splats
}

/// Values in [−1, 1).
pub fn noise(seed: u64, num: usize) -> Vec<f32> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..num).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// Counts around a group, images around a tile, nothing in view.
pub fn awkward_scenes() -> Vec<Scene> {
    let scene = |name, splats, camera| Scene { name, splats, camera };
    let counts = [("0 splats", 0), ("1 splat", 1), ("255 splats", 255), ("256 splats", 256)];
    let counts = counts.into_iter().chain([("257 splats", 257)]);
    let mut scenes: Vec<Scene> =
        counts.map(|(name, num)| scene(name, cloud(8, num, 1, -2.5), camera(48, 40))).collect();
    for (name, [width, height]) in
        [("1×1", [1, 1]), ("1×33", [1, 33]), ("17×16", [17, 16]), ("15×31", [15, 31])]
    {
        scenes.push(scene(name, cloud(9, 60, 0, -1.5), camera(width, height)));
    }
    for (name, offset) in [("all off-screen", [60.0, 0.0]), ("all behind", [0.0, -40.0])] {
        let mut splats = cloud(10, 100, 1, -3.0);
        for mean in &mut splats.means {
            *mean = [mean[0] + offset[0], mean[1], mean[2] + offset[1]];
        }
        scenes.push(scene(name, splats, camera(48, 40)));
    }
    scenes
}

/// The scenes on which the CPU rasteriser is the oracle.
pub fn scenes() -> Vec<Scene> {
    let scene = |name, splats, camera| Scene { name, splats, camera };
    let mut covering = cloud(5, 3, 1, -2.0);
    covering.log_scales[1] = [3.0; 3];
    covering.means[1] = [0.0, 0.0, 3.0];
    vec![
        scene("room", cloud(1, 1500, 3, -3.0), camera(200, 120)),
        scene("odd size", cloud(2, 400, 2, -2.5), camera(67, 45)),
        scene("close", cloud(3, 300, 1, -1.5), {
            Camera::look_at([0.1, 0.1, -0.6], [0.0; 3], [0.0, 1.0, 0.0], 1.4, 96, 80)
        }),
        scene("one tile", cloud(4, 10_000, 0, -5.0), camera(16, 16)),
        scene("one covers all", covering, camera(130, 70)),
    ]
}
