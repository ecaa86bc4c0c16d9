//! The source's geometry at the edit frame and at a few other times.

use gs_core::{DynamicScene, SceneError, Splats, SplatsError, TimeRange, quat};
use rayon::prelude::*;

/// Share of its weight that a fully faded source keeps, so that relative weights remain if all
/// sources have faded.
pub(crate) const FADED: f64 = 1e-4;

/// State of the source at the edit frame and the key times; rows are source rows.
#[derive(Debug)]
pub(crate) struct KeyFrames {
    /// All stored parameters at the edit frame.
    pub(crate) at_edit: Splats,
    /// Key times, ascending, none of them the edit time.
    pub(crate) times: Vec<f32>,
    /// Centres at each key time, `[T][N]`.
    pub(crate) means: Vec<Vec<[f32; 3]>>,
    /// Unit relative rotations since the edit frame, at each key time, `[T][N]`; identity for zero
    /// quaternions.
    pub(crate) rotations: Vec<Vec<[f32; 4]>>,
    /// Opacity at each key time divided by that at the edit frame, at most 1, `[T][N]`; empty if
    /// the opacities of the scene are constant.
    seen: Vec<Vec<f32>>,
    /// Rows with a value that is not finite at some time.
    pub(crate) broken: Vec<bool>,
}

impl KeyFrames {
    /// Evaluates the source at `edit_time` and at up to `count` other times: its own frames if it
    /// has few enough, else evenly spread ones.
    pub(crate) fn of(
        source: &dyn DynamicScene,
        edit_time: f32,
        count: usize,
        progress: &dyn Fn(f32),
    ) -> Result<Self, SceneError> {
        let at_edit = source.at(edit_time)?;
        at_edit.check_shapes()?;
        let times = key_times(source.time_range(), source.num_frames(), edit_time, count);
        let mut broken: Vec<bool> = (0..at_edit.len()).map(|i| is_broken(&at_edit, i)).collect();
        let (mut means, mut rotations, mut seen) = (Vec::new(), Vec::new(), Vec::new());
        let fades = source.fades();
        let mut splats = Splats::default();
        for (done, &t) in times.iter().enumerate() {
            if fades {
                source.at_into(t, &mut splats)?;
            } else {
                source.geometry_into(t, &mut splats)?;
            }
            check_rows(&splats, at_edit.len())?;
            if fades {
                splats.check_shapes()?;
            }
            for (i, broken) in broken.iter_mut().enumerate() {
                *broken |= is_broken(&splats, i);
            }
            let rows = || (0..splats.len()).into_par_iter().with_min_len(1024);
            rotations.push(rows().map(|i| rotation_between(&at_edit, &splats, i)).collect());
            means.push(splats.means.clone());
            if fades {
                seen.push(rows().map(|i| still_seen(&at_edit, &splats, i)).collect());
            }
            progress((done + 1) as f32 / times.len() as f32);
        }
        Ok(Self { at_edit, times, means, rotations, seen, broken })
    }

    /// Whether any opacity changes over time.
    pub(crate) fn fades(&self) -> bool {
        !self.seen.is_empty()
    }

    /// Presence of source `i` at key time `k`, 0 to 1.
    pub(crate) fn seen(&self, k: usize, i: usize) -> f64 {
        self.seen.get(k).map_or(1.0, |seen| f64::from(seen[i]))
    }

    /// Displacement of source `i` from the edit frame to key time `k`, world units.
    pub(crate) fn displacement(&self, k: usize, i: usize) -> [f64; 3] {
        let (x, y) = (self.at_edit.means[i], self.means[k][i]);
        [0, 1, 2].map(|axis| f64::from(y[axis]) - f64::from(x[axis]))
    }
}

/// Verifies that the number of rows is constant, so that ids are never out of range.
pub(crate) fn check_rows(at_t: &Splats, num_splats: usize) -> Result<(), SceneError> {
    let lengths = [
        ("means", at_t.means.len()),
        ("quats", at_t.quats.len()),
        ("log_scales", at_t.log_scales.len()),
    ];
    for (field, found) in lengths {
        if found != num_splats {
            return Err(
                SplatsError::Shape { field, found, expected: num_splats, num_splats }.into()
            );
        }
    }
    Ok(())
}

/// Opacity of splat `i` now divided by that at the edit frame, at most 1; 0 if either is NaN.
pub(crate) fn still_seen(at_edit: &Splats, at_t: &Splats, i: usize) -> f32 {
    let ratio = at_t.opacity(i) / at_edit.opacity(i);
    if ratio.is_nan() { 0.0 } else { ratio.min(1.0) }
}

fn is_broken(splats: &Splats, i: usize) -> bool {
    let finite = |values: &[f32]| values.iter().all(|value| value.is_finite());
    !(finite(&splats.means[i]) && finite(&splats.quats[i]))
}

fn rotation_between(at_edit: &Splats, at_t: &Splats, i: usize) -> [f32; 4] {
    let q1 = quat::normalize(at_edit.quats[i]);
    let r = quat::mul(quat::normalize(at_t.quats[i]), quat::conjugate(q1));
    if quat::dot(r, r) > 0.5 { quat::align(r, quat::IDENTITY) } else { quat::IDENTITY }
}

fn key_times(range: TimeRange, frames: Option<usize>, edit_time: f32, count: usize) -> Vec<f32> {
    let mut times = if let Some(frames) = frames {
        let all: Vec<f32> = range.frames(frames).into_iter().filter(|&t| t != edit_time).collect();
        if all.len() <= count {
            all
        } else {
            // Includes both ends; integers, so that the scene is evaluated at its own frames.
            let step = |i: usize| i * (all.len() - 1) / count.saturating_sub(1).max(1);
            (0..count).map(|i| all[step(i)]).collect()
        }
    } else {
        let mut times = range.frames(count + 1);
        let from_edit = |i: &usize| (times[*i] - edit_time).abs();
        if let Some(nearest) = (0..times.len()).min_by(|a, b| from_edit(a).total_cmp(&from_edit(b)))
        {
            times.remove(nearest);
        }
        times
    };
    times.retain(|&t| t != edit_time);
    times.dedup();
    times
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_frames_of_a_short_sequence_are_key_times() {
        let times = key_times(TimeRange::UNIT, Some(5), 0.25, 12);
        assert_eq!(times, [0.0, 0.5, 0.75, 1.0], "all but the edit frame");
    }

    #[test]
    fn long_sequences_are_sampled_including_both_ends() {
        let times = key_times(TimeRange::UNIT, Some(301), 0.0, 12);
        assert_eq!((times.len(), times[11]), (12, 1.0), "{times:?}");
        let all = TimeRange::UNIT.frames(301);
        assert!(times.iter().all(|t| all.contains(t)), "only stored frames: {times:?}");
    }

    #[test]
    fn the_edit_time_is_excluded_from_the_key_times_of_continuous_fields() {
        let times = key_times(TimeRange::UNIT, None, 0.0, 4);
        assert_eq!(times, [0.25, 0.5, 0.75, 1.0], "the start is the edit frame");
        assert!(key_times(TimeRange { start: 0.5, end: 0.5 }, None, 0.5, 4).is_empty(), "still");
    }
}
