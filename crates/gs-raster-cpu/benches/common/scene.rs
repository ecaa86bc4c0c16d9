//! Seeded scenes with the statistics of trained ones: clustered surfaces, log-normal scales, mostly
//! very low or very high opacities.

use gs_core::{Camera, Splats, sh};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Splats, columns, rows.
pub(crate) const SIZES: [(usize, u32, u32); 4] =
    [(10_000, 800, 600), (100_000, 800, 600), (100_000, 1352, 1014), (1_000_000, 1352, 1014)];

/// Standard normal deviate.
fn normal(rng: &mut Pcg64Mcg) -> f32 {
    let u: f32 = rng.random_range(1e-7..1.0);
    let v: f32 = rng.random_range(0.0..std::f32::consts::TAU);
    (-2.0 * u.ln()).sqrt() * v.cos()
}

/// `count` splats: flat discs on 60 bumpy spheres inside a room of 8 units; their size shrinks with
/// their number, as on a surface of fixed area.
pub(crate) fn splats(count: usize, seed: u64) -> Splats<f32> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let clusters: Vec<([f32; 3], f32)> = (0..60)
        .map(|_| {
            let centre = [2.5, 1.8, 2.5].map(|extent: f32| rng.random_range(-extent..extent));
            (centre, 0.15 + 0.35 * rng.random::<f32>())
        })
        .collect();
    let size = 0.012 * (100_000.0 / count as f32).sqrt();
    let mut splats = Splats::with_capacity(count, 3);
    for _ in 0..count {
        let (centre, radius) = clusters[rng.random_range(0..clusters.len())];
        let direction = [normal(&mut rng), normal(&mut rng), normal(&mut rng)];
        let norm = direction.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-3);
        let reach = radius * (1.0 + 0.1 * normal(&mut rng)) / norm;
        splats.means.push([0, 1, 2].map(|k| centre[k] + direction[k] * reach));
        splats.quats.push([0; 4].map(|_| normal(&mut rng)));
        let base = size.ln() + 0.7 * normal(&mut rng);
        splats.log_scales.push([base, base + 0.3 * normal(&mut rng), base - 1.2]);
        splats.opacity_logits.push(0.5 + 2.5 * normal(&mut rng));
        for k in 0..sh::num_coeffs(3) {
            let spread = if k == 0 { 1.0 } else { 0.1 };
            splats.sh.push([0; 3].map(|_| spread * normal(&mut rng)));
        }
    }
    splats
}

/// A camera in front of the scene.
pub(crate) fn camera(width: u32, height: u32) -> Camera {
    Camera::look_at([0.3, -0.4, -5.2], [0.0; 3], [0.0, -1.0, 0.0], 0.8, width, height)
}

/// A gradient like that of an image loss: bounded, of both signs.
pub(crate) fn upstream(values: usize) -> Vec<f32> {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    (0..values).map(|_| rng.random_range(-0.5..0.5)).collect()
}
