//! Infers the index rule with which a grid was trained from the
//! entries that training did not change.
//!
//! Table entries are initialised within ±1e-4 and change only when looked up. Under the older rule,
//! an entry of an affected level depends on x and at most a few low bits of y, so training changes
//! only entries whose x is that of a moving Gaussian; under the current rule it changes all entries
//! alike. The positions of the moving Gaussians are known, so the rules are distinguished by how
//! many entries *outside* their x slices were changed.

use gs_deform::{HashGrid, IndexRule};

/// Magnitude below which an entry is unchanged since initialisation; half precision rounds 1e-4 up.
const UNTOUCHED: f32 = 1.01e-4;
/// Slices of the x axis.
const BINS: usize = 256;
/// Smallest number of entries on either side for a result.
const ENOUGH: usize = 1000;
/// Share of changed entries inside the slices below which the grid was hardly trained.
const TRAINED: f64 = 0.1;

/// The rule that explains the table, from the x coordinates in the box
/// of the moving Gaussians; `None` if both do.
pub(super) fn infer(grid: &HashGrid, xs: &[f32]) -> Option<IndexRule> {
    let occupied = occupied(xs);
    // Changed entries and all entries, outside and inside the slices.
    let mut counts = [[0_usize; 2]; 2];
    let older = grid.shape().levels(IndexRule::Older);
    for level in grid.shape().ambiguous_levels() {
        let resolution = older[level].resolution as usize;
        let entries = grid.entries(&older[level]).chunks_exact(grid.shape().features);
        if !(older[level].size as usize).is_multiple_of(resolution) {
            continue; // x cannot be determined from an index.
        }
        for (index, entry) in entries.enumerate() {
            let inside = occupied[(index % resolution) * BINS / resolution];
            let side = &mut counts[usize::from(inside)];
            side[0] += usize::from(entry.iter().any(|value| value.abs() > UNTOUCHED));
            side[1] += 1;
        }
    }
    if counts.iter().any(|side| side[1] < ENOUGH) {
        return None;
    }
    let [outside, inside] = counts.map(|[touched, all]| touched as f64 / all as f64);
    match outside / inside {
        _ if inside < TRAINED => None,
        ratio if ratio < 0.3 => Some(IndexRule::Older),
        ratio if ratio > 0.7 => Some(IndexRule::Current),
        _ => None,
    }
}

/// Slices of x that contain moving Gaussians, and their neighbours,
/// because Gaussians drift during training.
fn occupied(xs: &[f32]) -> [bool; BINS] {
    let mut occupied = [false; BINS];
    for x in xs {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "coordinates of the box lie in 0..=1"
        )]
        let bin = ((x * BINS as f32) as usize).min(BINS - 1);
        for near in bin.saturating_sub(1)..=(bin + 1).min(BINS - 1) {
            occupied[near] = true;
        }
    }
    occupied
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_deform::GridShape;

    const SHAPE: GridShape = GridShape { levels: 13, features: 1, log2_table: 16, base: 16 };

    /// Numbers in 0..1, seeded.
    fn random(seed: &mut u64) -> f32 {
        *seed =
            seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 40) as f32 / (1_u64 << 24) as f32
    }

    /// A table after training: entries that `rule` looks up for `points`
    /// Gaussians within `x` over some frames are changed.
    fn trained(rule: IndexRule, points: usize, x: (f32, f32)) -> (HashGrid, Vec<f32>) {
        let mut seed = 7;
        let mut table: Vec<f32> =
            (0..SHAPE.num_entries()).map(|_| (random(&mut seed) * 2.0 - 1.0) * 1e-4).collect();
        let level = &SHAPE.levels(rule)[12];
        let mut xs = Vec::new();
        for _ in 0..points {
            let p = [x.0 + (x.1 - x.0) * random(&mut seed), random(&mut seed), random(&mut seed)];
            xs.push(p[0]);
            for frame in 0..12_u8 {
                let drift = 1e-3 * random(&mut seed);
                let cells =
                    [p[0] + drift, p[1], p[2], f32::from(frame) / 300.0].map(|c| level.locate(c).0);
                for k in 0..16 {
                    let corner = std::array::from_fn(|d| cells[d] + (k >> d & 1));
                    table[level.start + level.index(corner) as usize] = 0.01;
                }
            }
        }
        (HashGrid::new(SHAPE, IndexRule::Current, table).unwrap(), xs)
    }

    #[test]
    fn the_rule_is_inferred_from_unchanged_entries() {
        for rule in [IndexRule::Current, IndexRule::Older] {
            let (grid, xs) = trained(rule, 4000, (0.3, 0.6));
            assert_eq!(infer(&grid, &xs), Some(rule), "something in the middle moves");
        }
    }

    #[test]
    fn no_rule_is_inferred_without_evidence() {
        let (grid, xs) = trained(IndexRule::Older, 4000, (0.0, 1.0));
        assert_eq!(infer(&grid, &xs), None, "something moves everywhere");
        let (grid, _) = trained(IndexRule::Current, 0, (0.0, 1.0));
        assert_eq!(infer(&grid, &[0.5]), None, "never trained");
        assert_eq!(infer(&grid, &[]), None, "nothing moves");
    }
}
