//! [`PatchStatistics`]: distance between the patch distributions of two images.
//!
//! Textures and brush strokes are described by which patches occur, not by where they occur. The
//! distance is the sliced Wasserstein distance between the two sets of patches: for random unit
//! directions in patch space, the mean squared difference of the sorted projections (Rabin et al.
//! 2011, for textures; Elnekave and Weiss 2022, with patches of raw pixels).

use c4d_metrics::{halved, pixels_under};
use gs_core::{Image, Real, SplitMix64, standard_normal};
use rayon::prelude::*;

/// Maximum number of patches drawn per image.
const PATCHES: usize = 2048;
/// Number of random directions.
const DIRECTIONS: usize = 64;
/// Minimum number of patches for which a distribution is compared.
const MIN_PATCHES: usize = 32;

/// An RGB image and the pixels that belong to it.
#[derive(Debug, Clone, Default)]
pub(crate) struct MaskedImage {
    /// `[H,W,3]`, 0 to 1.
    pub(crate) image: Image,
    /// Pixels that may be used, `[H,W]`.
    pub(crate) mask: Vec<bool>,
}

impl MaskedImage {
    /// Half the size: means of 2×2 pixels. A pixel belongs to the image if all four do.
    pub(crate) fn halved(&self) -> Self {
        let image = halved(&self.image);
        let mask = (0..image.width * image.height)
            .map(|p| pixels_under(p, image.width, self.image.width).iter().all(|&q| self.mask[q]))
            .collect();
        Self { image, mask }
    }

    /// Upper left corners of the patches of `side` × `side` pixels that lie within the mask.
    pub(crate) fn patch_corners(&self, side: usize) -> Vec<u32> {
        let (width, height) = (self.image.width, self.image.height);
        if width < side || height < side {
            return Vec::new();
        }
        // Length of the run of usable pixels that starts at each pixel, then runs of full rows.
        let mut full_rows = vec![0_u8; width];
        let mut corners = Vec::new();
        for y in (0..height).rev() {
            let mut run = 0_u8;
            for x in (0..width).rev() {
                run = if self.mask[y * width + x] { run.saturating_add(1) } else { 0 };
                let wide = usize::from(run) >= side;
                full_rows[x] = if wide { full_rows[x].saturating_add(1) } else { 0 };
                if usize::from(full_rows[x]) >= side {
                    corners.extend(u32::try_from(y * width + x));
                }
            }
        }
        corners.reverse();
        corners
    }
}

/// Patches drawn from an image.
#[derive(Debug, Clone)]
struct Patches {
    corners: Vec<u32>,
    /// `[3·side², number of patches]`.
    values: Vec<f32>,
}

impl Patches {
    /// All patches at `corners`, or a random sample of them in ascending order.
    fn draw(image: &Image, corners: &[u32], side: usize, random: &mut SplitMix64) -> Self {
        let corners = if corners.len() <= PATCHES {
            corners.to_vec()
        } else {
            // One patch of each of `PATCHES` equal ranges.
            (0..PATCHES)
                .map(|i| {
                    let (from, to) =
                        (i * corners.len() / PATCHES, (i + 1) * corners.len() / PATCHES);
                    corners[from + random.below(to - from)]
                })
                .collect()
        };
        let count = corners.len();
        let mut values = vec![0.0; 3 * side * side * count];
        values.par_chunks_mut(count.max(1)).enumerate().for_each(|(value, row)| {
            let offset = offset(value, side, image.width);
            for (out, &corner) in row.iter_mut().zip(&corners) {
                *out = image.data[3 * corner as usize + offset];
            }
        });
        Self { corners, values }
    }

    fn projected(&self, direction: &[f32]) -> Vec<f32> {
        let mut sums = vec![0.0; self.corners.len()];
        for (row, &weight) in self.values.chunks_exact(self.corners.len().max(1)).zip(direction) {
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += weight * value;
            }
        }
        sums
    }
}

/// Index of value `value` of a patch relative to the first value of its corner pixel.
fn offset(value: usize, side: usize, width: usize) -> usize {
    let (pixel, channel) = (value / 3, value % 3);
    3 * (pixel / side * width + pixel % side) + channel
}

/// The patches of one image, to which those of other images are compared.
#[derive(Debug, Clone)]
pub(crate) struct PatchStatistics {
    target: Image,
    corners: Vec<u32>,
    side: usize,
}

impl PatchStatistics {
    /// Patches of `side` × `side` pixels; `None` if the image has too few.
    pub(crate) fn of(target: &MaskedImage, side: usize) -> Option<Self> {
        let corners = target.patch_corners(side);
        let target = target.image.clone();
        (corners.len() >= MIN_PATCHES).then_some(Self { target, corners, side })
    }

    /// Squared sliced Wasserstein distance of the patches of `image` at `corners` to those of the
    /// target, per value of a patch; its gradient is added to `v_image` (`[H,W,3]`). `None` if
    /// there are too few patches. Patches and directions are drawn with `seed`.
    pub(crate) fn distance(
        &self,
        image: &Image,
        corners: &[u32],
        seed: u64,
        v_image: Option<&mut Image>,
    ) -> Option<f64> {
        if corners.len() < MIN_PATCHES {
            return None;
        }
        let mut random = SplitMix64::new(seed);
        let side = self.side;
        let ours = Patches::draw(image, corners, side, &mut random);
        let theirs = Patches::draw(&self.target, &self.corners, side, &mut random);
        let directions: Vec<Vec<f32>> =
            (0..DIRECTIONS).map(|_| direction(3 * side * side, &mut random)).collect();
        let results: Vec<(f64, Vec<f32>)> = directions
            .par_iter()
            .map(|direction| differences(&ours.projected(direction), theirs.projected(direction)))
            .collect();
        let count = ours.corners.len();
        if let Some(v_image) = v_image {
            let factor = 2.0 / (DIRECTIONS * count) as f32;
            let mut v_values = vec![0.0_f32; 3 * side * side * count];
            v_values.par_chunks_mut(count).enumerate().for_each(|(value, row)| {
                for (direction, (_, differences)) in directions.iter().zip(&results) {
                    let scale = factor * direction[value];
                    for (out, difference) in row.iter_mut().zip(differences) {
                        *out += scale * difference;
                    }
                }
            });
            for (value, row) in v_values.chunks_exact(count).enumerate() {
                let offset = offset(value, side, image.width);
                for (&corner, v) in ours.corners.iter().zip(row) {
                    v_image.data[3 * corner as usize + offset] += v;
                }
            }
        }
        let sum: f64 = results.iter().map(|(sum, _)| sum).sum();
        Some(sum / (DIRECTIONS * count) as f64)
    }
}

/// A uniform number in `[0, 1)`.
fn uniform(random: &mut SplitMix64) -> f32 {
    (random.next_u64() >> 40) as f32 / (1_u32 << 24) as f32
}

/// A random unit vector.
fn direction(len: usize, random: &mut SplitMix64) -> Vec<f32> {
    let mut uniform = || uniform(random);
    let mut direction: Vec<f32> = (0..len).map(|_| standard_normal(uniform(), uniform())).collect();
    let norm = direction.iter().map(|v| v * v).sum::<f32>().sqrt();
    for value in &mut direction {
        *value /= norm;
    }
    direction
}

/// Sum of the squared differences between each value and the target value of the same rank, and
/// the differences. Ranks are scaled if the numbers of values differ.
fn differences(values: &[f32], mut target: Vec<f32>) -> (f64, Vec<f32>) {
    target.sort_unstable_by(f32::total_cmp);
    let mut order: Vec<u32> = (0..).take(values.len()).collect();
    order.sort_unstable_by(|&a, &b| {
        values[a as usize].total_cmp(&values[b as usize]).then(a.cmp(&b))
    });
    let mut differences = vec![0.0; values.len()];
    let mut sum = 0.0;
    for (rank, &row) in order.iter().enumerate() {
        let position = (rank as f64 + 0.5) / values.len() as f64 * target.len() as f64 - 0.5;
        let position = position.clamp(0.0, (target.len() - 1) as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let below = position as usize;
        let above = (below + 1).min(target.len() - 1);
        let share = (position - below as f64).as_f32();
        let expected = target[below] + share * (target[above] - target[below]);
        let difference = values[row as usize] - expected;
        differences[row as usize] = difference;
        sum += f64::from(difference * difference);
    }
    (sum, differences)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(width: usize, height: usize, seed: u64, period: usize) -> MaskedImage {
        let mut random = SplitMix64::new(seed);
        let mut image = Image::zeros(width, height, 3);
        for (i, value) in image.data.iter_mut().enumerate() {
            let stripe = f32::from(u8::from((i / 3 % width) % period < period / 2));
            *value = 0.6 * stripe + 0.4 * uniform(&mut random);
        }
        MaskedImage { image, mask: vec![true; width * height] }
    }

    #[test]
    fn equal_distributions_are_closer_than_different_ones() {
        let statistics = PatchStatistics::of(&noise(64, 48, 1, 8), 7).unwrap();
        let distance = |other: &MaskedImage| {
            statistics.distance(&other.image, &other.patch_corners(7), 3, None).unwrap()
        };
        let same = distance(&noise(64, 48, 1, 8));
        let (alike, other) = (distance(&noise(60, 52, 2, 8)), distance(&noise(64, 48, 2, 16)));
        assert!(same < alike && alike < 0.2 * other, "{same} {alike} {other}");
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        let statistics = PatchStatistics::of(&noise(32, 32, 1, 6), 5).unwrap();
        let image = noise(20, 20, 5, 10);
        let corners = image.patch_corners(5);
        let mut gradient = Image::zeros(20, 20, 3);
        let value = |image: &Image| statistics.distance(image, &corners, 9, None).unwrap();
        statistics.distance(&image.image, &corners, 9, Some(&mut gradient)).unwrap();
        let mut worst = 0.0_f64;
        let scale = gradient.data.iter().fold(0.0_f32, |max, v| max.max(v.abs()));
        for at in (0..gradient.data.len()).step_by(17) {
            let step = 1e-2;
            let [mut above, mut below] = [image.image.clone(), image.image.clone()];
            above.data[at] += step;
            below.data[at] -= step;
            let slope = (value(&above) - value(&below)) / f64::from(2.0 * step);
            worst = worst.max((slope - f64::from(gradient.data[at])).abs() / f64::from(scale));
        }
        assert!(worst < 2e-2, "{worst}");
    }

    #[test]
    fn patches_lie_within_the_mask() {
        let mut image = noise(20, 16, 1, 4);
        image.mask = (0..20 * 16).map(|p| p % 20 < 9 && p / 20 >= 5).collect();
        let corners = image.patch_corners(7);
        let expected: Vec<u32> = (5..=9).flat_map(|y| (0..=2).map(move |x| y * 20 + x)).collect();
        assert_eq!(corners, expected);
        assert!(MaskedImage { mask: vec![false; 320], ..image }.patch_corners(7).is_empty());
    }
}
