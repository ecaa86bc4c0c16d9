//! Seeded random scenes.

use gs_core::{Camera, Real, Splats, UpstreamGrads, sh};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

pub(crate) struct Scene<F> {
    pub(crate) splats: Splats<F>,
    pub(crate) features: Vec<F>,
    pub(crate) camera: Camera,
}

/// `count` splats in front of a rolled, off-centre camera; `num_features` channels each.
pub(crate) fn random<F: Real>(
    count: usize,
    num_features: usize,
    size: [u32; 2],
    seed: u64,
) -> Scene<F> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut uniform = |low: f64, high: f64| F::from_double(rng.random_range(low..high));
    let mut splats = Splats::with_capacity(count, 2);
    let mut features = Vec::new();
    for _ in 0..count {
        splats.means.push([uniform(-1.0, 1.0), uniform(-1.0, 1.0), uniform(-1.0, 1.0)]);
        splats.quats.push([0; 4].map(|_| uniform(-1.0, 1.0)));
        splats.log_scales.push([0; 3].map(|_| uniform(-3.2, -1.2)));
        splats.opacity_logits.push(uniform(-2.0, 2.5));
        for k in 0..sh::num_coeffs(2) {
            let spread = if k == 0 { 0.9 } else { 0.15 };
            splats.sh.push([0; 3].map(|_| uniform(-spread, spread)));
        }
        features.extend((0..num_features).map(|_| uniform(-1.0, 1.0)));
    }
    let mut camera = Camera::look_at(
        [0.4, -0.5, -3.0],
        [0.1, 0.0, 0.0],
        [0.3, -1.0, 0.0],
        0.9,
        size[0],
        size[1],
    );
    camera.intrinsics.fx *= 1.07;
    camera.intrinsics.cx += 1.3;
    camera.intrinsics.cy -= 0.7;
    Scene { splats, features, camera }
}

/// Random gradients of all four outputs.
pub(crate) fn upstream<F: Real>(pixels: usize, num_features: usize, seed: u64) -> UpstreamGrads<F> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut plane =
        |n: usize| (0..n).map(|_| F::from_double(rng.random_range(-1.0..1.0))).collect::<Vec<F>>();
    UpstreamGrads {
        v_rgb: plane(3 * pixels),
        v_alpha: plane(pixels),
        v_depth: plane(pixels),
        v_features: plane(num_features * pixels),
    }
}
