//! Analysis of the scenes: visible rows, rows that both scenes share, and the extent.

use crate::PlayerError;
use gs_core::image_formation::ALPHA_THRESHOLD;
use gs_core::{DynamicScene, Splats, SplitMix64};
use std::collections::HashMap;

/// Share of the rows excluded at either end when the extent is
/// measured, to ignore floaters and backdrops.
const TRIM: f64 = 0.05;

/// Properties of the rows of one scene over all frames.
#[derive(Debug)]
pub(crate) struct SceneRows {
    /// Whether the row is finite in every frame and visible in at least one.
    usable: Vec<bool>,
    /// Fingerprint of means, quaternions and scales of all frames.
    geometry: Vec<u64>,
    /// Fingerprint of opacities and stored SH of all frames.
    appearance: Vec<u64>,
    /// Centres in the first frame.
    means: Vec<[f32; 3]>,
    /// Rows that are not finite in some frame.
    pub(crate) not_finite: usize,
    /// Other rows that are never visible.
    pub(crate) invisible: usize,
}

/// Rows of the two scenes by shared content. Geometry rows are stored in the order `a`,
/// `same_motion`, `shared`, `b`; appearances (opacity and colour) in the order `a`, `same_motion` of
/// the first scene, `shared`, `same_motion` of the second, `b`.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub(crate) struct RowGroups {
    /// Rows only in the first scene.
    pub(crate) a: Vec<usize>,
    /// Rows `(first, second)` with the same motion but different appearance.
    pub(crate) same_motion: Vec<(usize, usize)>,
    /// Rows `(first, second)` that are the same in every frame.
    pub(crate) shared: Vec<(usize, usize)>,
    /// Rows only in the second scene.
    pub(crate) b: Vec<usize>,
}

impl RowGroups {
    /// `[a, same_motion, shared, b]`.
    pub(crate) fn counts(&self) -> [usize; 4] {
        [self.a.len(), self.same_motion.len(), self.shared.len(), self.b.len()]
    }

    /// For each appearance in the order in which appearances are stored, its row in either scene.
    pub(crate) fn appearances(&self) -> Vec<[Option<usize>; 2]> {
        let first = self.a.iter().map(|&row| [Some(row), None]);
        let same_motion = self.same_motion.iter().map(|&(row, _)| [Some(row), None]);
        let shared = self.shared.iter().map(|&(first, second)| [Some(first), Some(second)]);
        let second_appearances = self.same_motion.iter().map(|&(_, row)| [None, Some(row)]);
        let second = self.b.iter().map(|&row| [None, Some(row)]);
        first.chain(same_motion).chain(shared).chain(second_appearances).chain(second).collect()
    }
}

/// Evaluates the scene at `time` and checks that rows persist.
pub(crate) fn evaluate(
    scene: &dyn DynamicScene,
    time: f32,
    out: &mut Splats,
) -> Result<(), PlayerError> {
    let failed = |source| PlayerError::Scene { time, source };
    scene.at_into(time, out).map_err(failed)?;
    out.check_shapes().map_err(|error| failed(error.into()))?;
    if out.len() != scene.num_splats() {
        return Err(PlayerError::Rows { time, found: out.len(), expected: scene.num_splats() });
    }
    Ok(())
}

impl SceneRows {
    /// Evaluates every frame and compares `sh_coeffs` coefficients of
    /// each splat. Calls `step` after each frame.
    pub(crate) fn analyze(
        scene: &dyn DynamicScene,
        times: &[f32],
        sh_coeffs: usize,
        step: &mut dyn FnMut(),
    ) -> Result<Self, PlayerError> {
        let rows = scene.num_splats();
        let mut finite = vec![true; rows];
        let mut visible = vec![false; rows];
        let (mut geometry, mut appearance) = (vec![0_u64; rows], vec![0_u64; rows]);
        let mut means = Vec::new();
        let mut splats = Splats::default();
        for &time in times {
            evaluate(scene, time, &mut splats)?;
            if means.is_empty() {
                means.clone_from(&splats.means);
            }
            for i in 0..rows {
                finite[i] &= splats.is_finite(i);
                visible[i] |= splats.opacity(i) >= ALPHA_THRESHOLD;
                let shape = splats.means[i].iter().chain(&splats.log_scales[i]);
                geometry[i] = shape.chain(&splats.quats[i]).copied().fold(geometry[i], mix);
                let colors = splats.sh_of(i).iter().take(sh_coeffs).flatten();
                appearance[i] =
                    colors.copied().fold(mix(appearance[i], splats.opacity_logits[i]), mix);
            }
            step();
        }
        let usable: Vec<bool> = finite.iter().zip(&visible).map(|(f, v)| *f && *v).collect();
        let not_finite = finite.iter().filter(|finite| !**finite).count();
        let invisible = rows - not_finite - usable.iter().filter(|usable| **usable).count();
        Ok(Self { usable, geometry, appearance, means, not_finite, invisible })
    }

    fn usable_rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.usable.len()).filter(|&row| self.usable[row])
    }

    /// Centres of the usable rows, first frame.
    fn usable_means(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        self.usable_rows().map(|row| self.means[row])
    }
}

/// One step of a fingerprint: bits of the value, mixed.
fn mix(state: u64, value: f32) -> u64 {
    SplitMix64::new(state.wrapping_add(u64::from(value.to_bits()))).next_u64()
}

/// Finds shared rows by value, for any order of the rows.
pub(crate) fn group(first: &SceneRows, second: Option<&SceneRows>) -> RowGroups {
    let Some(second) = second else {
        return RowGroups { a: first.usable_rows().collect(), ..RowGroups::default() };
    };
    let mut groups = RowGroups::default();
    let whole = |rows: &SceneRows, row: usize| (rows.geometry[row], rows.appearance[row]);
    let (shared, first_left, second_left) = matched(
        first.usable_rows().map(|row| (whole(first, row), row)),
        second.usable_rows().map(|row| (whole(second, row), row)),
    );
    groups.shared = shared;
    let (same_motion, first_left, second_left) = matched(
        first_left.into_iter().map(|row| (first.geometry[row], row)),
        second_left.into_iter().map(|row| (second.geometry[row], row)),
    );
    groups.same_motion = same_motion;
    groups.a = first_left;
    groups.b = second_left;
    groups
}

/// Pairs of rows with equal keys, lowest rows first, and the
/// unpaired rows of either side, ascending.
fn matched<K: Eq + std::hash::Hash>(
    first: impl Iterator<Item = (K, usize)>,
    second: impl Iterator<Item = (K, usize)>,
) -> (Vec<(usize, usize)>, Vec<usize>, Vec<usize>) {
    let first: Vec<(K, usize)> = first.collect();
    let mut rest_first: Vec<usize> = first.iter().map(|entry| entry.1).collect();
    let mut waiting: HashMap<K, Vec<usize>> = HashMap::new();
    // In reverse, so that the lowest row is popped first.
    for (key, row) in first.into_iter().rev() {
        waiting.entry(key).or_default().push(row);
    }
    let (mut pairs, mut rest_second) = (Vec::new(), Vec::new());
    for (key, row) in second {
        match waiting.get_mut(&key).and_then(Vec::pop) {
            Some(partner) => pairs.push((partner, row)),
            None => rest_second.push(row),
        }
    }
    pairs.sort_unstable();
    let mut taken = pairs.iter().map(|pair| pair.0).peekable();
    rest_first.retain(|row| taken.next_if_eq(row).is_none());
    (pairs, rest_first, rest_second)
}

/// Centre and longest side (1 if it is zero) of the box that contains the middle 90 % of the
/// centres along each axis, world units.
pub(crate) fn trimmed_box(scenes: &[&SceneRows]) -> ([f64; 3], f64) {
    let mut origin = [0.0; 3];
    let (mut robust, mut full) = (0.0_f64, 0.0_f64);
    for axis in 0..3 {
        let mut values: Vec<f32> =
            scenes.iter().flat_map(|rows| rows.usable_means().map(|mean| mean[axis])).collect();
        values.sort_by(f32::total_cmp);
        let Some(last) = values.len().checked_sub(1) else { continue };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a fraction of a length fits a length"
        )]
        let cut = (last as f64 * TRIM) as usize;
        let (low, high) = (f64::from(values[cut]), f64::from(values[last - cut]));
        origin[axis] = f64::midpoint(low, high);
        robust = robust.max(high - low);
        full = full.max(f64::from(values[last]) - f64::from(values[0]));
    }
    let size = [robust, full].into_iter().find(|size| *size > 0.0 && size.is_finite());
    (origin, size.unwrap_or(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_rows_are_paired_in_any_order() {
        let first = [(7, 0), (8, 1), (7, 2), (9, 3)];
        let second = [(9, 0), (7, 1), (5, 2), (7, 3), (7, 4)];
        let (pairs, left, right) = matched(first.into_iter(), second.into_iter());
        assert_eq!(pairs, [(0, 1), (2, 3), (3, 0)], "duplicates are paired one to one");
        assert_eq!((left, right), (vec![1], vec![2, 4]), "unpaired rows, ascending");
    }
}
