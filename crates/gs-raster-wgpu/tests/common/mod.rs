//! One device per test binary and mode, and scenes.

#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part")]

use gs_core::{Camera, Splats};
use gs_raster_wgpu::{AdapterChoice, GpuContext, GpuOptions, WgpuRasterizer};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::OnceLock;

/// Configurations of the same adapter; every test of images and gradients runs in several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Core WGSL, default limits.
    Portable,
    /// All features of the adapter except float atomics.
    Deterministic,
    /// All features of the adapter.
    Native,
    /// Core WGSL with bindings so small that harmonics and gradients of pairs are split.
    Tiny,
}

pub const MODES: [Mode; 4] = [Mode::Portable, Mode::Deterministic, Mode::Native, Mode::Tiny];

/// The adapter named by `C4D_TEST_ADAPTER` (`auto` or an index), by
/// default a software one. Fails if there is none.
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
        let mut options = GpuOptions::default();
        options.portable = matches!(mode, Mode::Portable | Mode::Tiny);
        options.deterministic = mode == Mode::Deterministic;
        options.max_binding_bytes = (mode == Mode::Tiny).then_some(640 << 10);
        options.timestamps = mode == Mode::Native;
        GpuContext::with_options(choice(), options).unwrap_or_else(|error| panic!("{error}"))
    });
    WgpuRasterizer::new(context.clone())
}

/// A scene and a camera that looks at it.
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

/// Splat counts around the group size, image sizes around the
/// tile size, and scenes with nothing in view.
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

/// Scenes compared with the CPU rasteriser.
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
