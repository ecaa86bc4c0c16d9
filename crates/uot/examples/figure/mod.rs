//! Seeded point clouds for the examples and the bench.

use rand::{RngExt, SeedableRng};

/// Points on the limbs, torso and head of a figure of height 2, pushed outwards by `offset`.
pub(crate) fn figure(n: usize, seed: u64, offset: f64) -> Vec<[f64; 3]> {
    // start, end, radius
    const PARTS: [([f64; 3], [f64; 3], f64); 6] = [
        ([0.0, 0.8, 0.0], [0.0, 1.4, 0.0], 0.20),
        ([0.0, 1.6, 0.0], [0.0, 1.8, 0.0], 0.12),
        ([0.25, 1.4, 0.0], [0.7, 1.0, 0.2], 0.06),
        ([-0.25, 1.4, 0.0], [-0.7, 1.5, 0.1], 0.06),
        ([0.1, 0.8, 0.0], [0.2, 0.0, 0.1], 0.08),
        ([-0.1, 0.8, 0.0], [-0.2, 0.0, -0.1], 0.08),
    ];
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    (0..n)
        .map(|_| {
            let (start, end, radius) = PARTS[rng.random_range(0..PARTS.len())];
            let t: f64 = rng.random();
            let direction: [f64; 3] = std::array::from_fn(|_| rng.random::<f64>() - 0.5);
            let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
            std::array::from_fn(|k| {
                start[k] + t * (end[k] - start[k]) + (radius + offset) * direction[k] / length
            })
        })
        .collect()
}
