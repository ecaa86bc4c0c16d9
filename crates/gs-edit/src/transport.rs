//! Optimal transport of the colours of a selection to those of a picture.

use crate::color::ColorStats;
use crate::color_map::ColorMap;
use gs_core::symmetric_eigen;
use rand::{RngExt, SeedableRng};

/// Variance added to both distributions (half a step of 8 bits, squared). It bounds the stretch of
/// selections with a single colour.
const NOISE_VARIANCE: f64 = 0.25 / (255.0 * 255.0);

/// Number of random frames of the sliced transport, three directions each. With 32, a normal
/// distribution becomes two colours to within 0.1 for 95 % of its splats (the test below).
const FRAMES: usize = 32;

/// Random seed of the frames.
const SEED: u64 = 7;

/// The optimal map between normal distributions with these moments (squared Euclidean cost):
/// `c ↦ μ_t + A·(c − μ_s)`, `A = Σ_s^{-½} (Σ_s^{½} Σ_t Σ_s^{½})^{½} Σ_s^{-½}`. `A` is symmetric and
/// positive definite, the identity if both are equal.
pub(crate) fn gaussian(source: &ColorStats, target: &ColorStats) -> ColorMap {
    let [s, t] = [source, target].map(|stats| {
        let mut covariance = stats.covariance;
        for (i, row) in covariance.iter_mut().enumerate() {
            row[i] += NOISE_VARIANCE;
        }
        covariance
    });
    let (root, inverse) = (power(s, 0.5), power(s, -0.5));
    let middle = power(product(product(root, t), root), 0.5);
    let matrix = product(product(inverse, middle), inverse);
    let linear = ColorMap { matrix, offset: [0.0; 3] };
    let moved = linear.apply_linear(source.mean);
    ColorMap { matrix, offset: [0, 1, 2].map(|c| target.mean[c] - moved[c]) }
}

/// Moves weighted colours to the distribution of `target` (weights above 0):
/// one-dimensional transport along the axes of [`FRAMES`] random frames, one after the other.
pub(crate) fn sliced(colors: &mut [[f64; 3]], weights: &[f64], target: &[([f64; 3], f64)]) {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(SEED);
    let mut order: Vec<usize> = (0..colors.len()).collect();
    let mut steps = vec![[0.0; 3]; colors.len()];
    for _ in 0..FRAMES {
        let frame = random_frame(&mut rng);
        steps.fill([0.0; 3]);
        for axis in frame {
            let along = |rgb: &[f64; 3]| (0..3).map(|c| axis[c] * rgb[c]).sum::<f64>();
            let mut values: Vec<(f64, f64)> =
                target.iter().map(|(rgb, weight)| (along(rgb), *weight)).collect();
            values.sort_by(|a, b| a.0.total_cmp(&b.0));
            let projected: Vec<f64> = colors.iter().map(along).collect();
            order.sort_by(|&a, &b| projected[a].total_cmp(&projected[b]).then(a.cmp(&b)));
            for (row, value) in
                order.iter().zip(monotone_map(&values, order.iter().map(|&i| weights[i])))
            {
                for c in 0..3 {
                    steps[*row][c] += axis[c] * (value - projected[*row]);
                }
            }
        }
        for (rgb, step) in colors.iter_mut().zip(&steps) {
            *rgb = [0, 1, 2].map(|c| rgb[c] + step[c]);
        }
    }
}

/// Optimal transport in one dimension: for each weight of an ascending sequence, the value of the
/// sorted `target` at the same share of the total weight, linear between the middles of weights.
fn monotone_map(target: &[(f64, f64)], weights: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let total: f64 = weights.clone().sum();
    let target_total: f64 = target.iter().map(|(_, weight)| weight).sum();
    let middles: Vec<f64> = target
        .iter()
        .scan(0.0, |sum, (_, weight)| {
            *sum += weight;
            Some((*sum - 0.5 * weight) / target_total)
        })
        .collect();
    let (mut sum, mut next) = (0.0, 0);
    weights
        .map(|weight| {
            sum += weight;
            let share = (sum - 0.5 * weight) / total;
            while next < middles.len() && middles[next] < share {
                next += 1;
            }
            match (next.checked_sub(1), middles.get(next)) {
                (Some(below), Some(&above)) => {
                    let part = (share - middles[below]) / (above - middles[below]);
                    target[below].0 + part * (target[next].0 - target[below].0)
                }
                (None, _) => target[0].0,
                (Some(below), None) => target[below].0,
            }
        })
        .collect()
}

/// Three orthonormal directions, uniformly distributed: the axes of a random unit quaternion.
fn random_frame(rng: &mut rand_pcg::Pcg64Mcg) -> [[f64; 3]; 3] {
    loop {
        let q: [f64; 4] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let norm = q.iter().map(|v| v * v).sum::<f64>();
        if (0.01..=1.0).contains(&norm) {
            return gs_core::rotation_matrix(gs_core::quat::normalize(q));
        }
    }
}

fn product(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    a.map(|row| [0, 1, 2].map(|j| (0..3).map(|k| row[k] * b[k][j]).sum()))
}

/// A power of a symmetric positive definite matrix.
fn power(a: [[f64; 3]; 3], exponent: f64) -> [[f64; 3]; 3] {
    let (values, v) = symmetric_eigen(a);
    let powers = values.map(|value| value.max(1e-12).powf(exponent));
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| v[i][k] * powers[k] * v[j][k]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(mean: [f64; 3], axes: [[f64; 3]; 3], seed: u64) -> Vec<([f64; 3], f64)> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        (0..4000)
            .map(|_| {
                let z: [f64; 3] = std::array::from_fn(|_| {
                    (0..6).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>() * 1.4
                });
                ([0, 1, 2].map(|c| mean[c] + (0..3).map(|k| axes[c][k] * z[k]).sum::<f64>()), 1.0)
            })
            .collect()
    }

    fn stats(points: &[([f64; 3], f64)]) -> ColorStats {
        ColorStats::of(points.iter().copied()).unwrap()
    }

    fn distance(a: &ColorStats, b: &ColorStats) -> f64 {
        let mean = (0..3).map(|c| (a.mean[c] - b.mean[c]).abs()).fold(0.0, f64::max);
        let both = a.covariance.iter().flatten().zip(b.covariance.iter().flatten());
        mean.max(both.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max))
    }

    #[test]
    fn gaussian_transport_reaches_mean_and_covariance() {
        let source =
            cloud([0.3, 0.5, 0.4], [[0.1, 0.0, 0.0], [0.05, 0.08, 0.0], [0.0, 0.02, 0.05]], 1);
        let target =
            cloud([0.6, 0.2, 0.5], [[0.02, 0.1, 0.0], [0.1, 0.0, 0.02], [0.0, 0.0, 0.15]], 2);
        let map = gaussian(&stats(&source), &stats(&target));
        let moved: Vec<_> = source.iter().map(|(rgb, w)| (map.apply(*rgb), *w)).collect();
        assert!(distance(&stats(&moved), &stats(&target)) < 1e-4, "{:?}", stats(&moved));
        for i in 0..3 {
            for j in 0..3 {
                assert!(
                    (map.matrix[i][j] - map.matrix[j][i]).abs() < 1e-9,
                    "a gradient of a convex function"
                );
            }
        }
        let same = gaussian(&stats(&source), &stats(&source));
        assert!((0..3).all(|c| (same.matrix[c][c] - 1.0).abs() < 1e-9), "identity: {same:?}");
    }

    #[test]
    fn sliced_transport_reaches_two_colours() {
        let source = cloud([0.5; 3], [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]], 3);
        // Two colours.
        let target: Vec<_> = (0..500)
            .map(|i| (if i % 4 == 0 { [0.9, 0.1, 0.1] } else { [0.1, 0.2, 0.8] }, 1.0))
            .collect();
        let mut colors: Vec<[f64; 3]> = source.iter().map(|(rgb, _)| *rgb).collect();
        let weights = vec![1.0; colors.len()];
        sliced(&mut colors, &weights, &target);
        let near = |rgb: &[f64; 3], to: [f64; 3]| (0..3).all(|c| (rgb[c] - to[c]).abs() < 0.1);
        let red = colors.iter().filter(|rgb| near(rgb, [0.9, 0.1, 0.1])).count();
        let blue = colors.iter().filter(|rgb| near(rgb, [0.1, 0.2, 0.8])).count();
        assert!((900..1100).contains(&red), "a quarter is red: {red}");
        assert!(red + blue > 3800, "nearly all are one of both: {red} {blue}");
    }

    #[test]
    fn a_single_colour_is_moved_without_stretching() {
        let flat = ColorStats { mean: [0.2; 3], covariance: [[0.0; 3]; 3] };
        let target =
            stats(&cloud([0.6; 3], [[0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.2]], 4));
        let map = gaussian(&flat, &target);
        let moved = map.apply([0.2; 3]);
        assert!((0..3).all(|c| (moved[c] - target.mean[c]).abs() < 1e-9), "{moved:?}");
        assert!(map.matrix.iter().flatten().all(|v| v.is_finite()), "{map:?}");
    }
}
