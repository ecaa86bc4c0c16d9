//! [`Lifetimes`]: which source splats are visible at which key times, and where they are.

use gs_core::{DynamicScene, SceneError, Splats};

/// Opacity below which a splat counts as invisible.
const MIN_OPACITY: f32 = 0.02;
/// Share of its own largest opacity below which a splat counts as invisible.
const SHARE_OF_PEAK: f32 = 0.05;
/// Minimum presence at which other splats follow a splat: near the ends of its lifetime, images
/// hardly constrain its position.
pub(crate) const FOLLOW_PRESENCE: f64 = 0.2;
/// Number of key times: the shortest expected lifetime, a twentieth of the clip, covers three.
const KEY_TIMES: usize = 65;
/// Largest number of splats times key times, 16 bytes each (384 MB); larger scenes get fewer key
/// times.
const MAX_SAMPLES: usize = 24_000_000;
const MIN_KEY_TIMES: usize = 17;

/// Opacities between which a splat's presence rises from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OpacityRange {
    /// The splat is visible above this opacity.
    pub(crate) floor: f32,
    /// Largest opacity at any key time.
    pub(crate) peak: f32,
}

impl OpacityRange {
    const NEVER: Self = Self { floor: f32::INFINITY, peak: f32::INFINITY };

    fn of(peak: f32) -> Self {
        let floor = MIN_OPACITY.max(SHARE_OF_PEAK * peak);
        if peak > floor { Self { floor, peak } } else { Self::NEVER }
    }

    /// Presence at this opacity: 0 at the floor, 1 at the peak, linear between them.
    pub(crate) fn presence(self, opacity: f32) -> f64 {
        let share = f64::from(opacity - self.floor) / f64::from(self.peak - self.floor);
        if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
    }
}

/// Positions and opacities of all source splats at the key times.
#[derive(Debug)]
pub(crate) struct Lifetimes {
    /// Ascending; one of them is the edit time.
    pub(crate) times: Vec<f32>,
    /// Index of the edit time in `times`.
    pub(crate) edit: usize,
    /// Positions, world units, `[T][N]`.
    pub(crate) means: Vec<Vec<[f32; 3]>>,
    /// Opacities after the sigmoid, `[T][N]`.
    pub(crate) opacities: Vec<Vec<f32>>,
    /// Range of opacities of each splat, `[N]`.
    pub(crate) opacity_ranges: Vec<OpacityRange>,
    /// Key time of the largest opacity, `[N]`.
    pub(crate) peak_time: Vec<usize>,
}

impl Lifetimes {
    pub(crate) fn of(
        source: &dyn DynamicScene,
        edit_time: f32,
        progress: &dyn Fn(f32),
    ) -> Result<Self, SceneError> {
        let n = source.num_splats();
        let count = (MAX_SAMPLES / n.max(1)).clamp(MIN_KEY_TIMES, KEY_TIMES);
        let times = key_times(source, edit_time, count);
        let edit = times.iter().position(|&t| t >= edit_time).unwrap_or(times.len() - 1);
        let (mut means, mut opacities) = (Vec::new(), Vec::new());
        let mut splats = Splats::default();
        let mut broken = vec![false; n];
        for (k, &t) in times.iter().enumerate() {
            source.at_into(t, &mut splats)?;
            splats.check_shapes()?;
            for (i, broken) in broken.iter_mut().enumerate() {
                let finite = |values: &[f32]| values.iter().all(|value| value.is_finite());
                *broken |= !(finite(&splats.means[i]) && finite(&splats.quats[i]));
            }
            means.push(splats.means.clone());
            opacities.push((0..n).map(|i| splats.opacity(i)).collect::<Vec<f32>>());
            progress((k + 1) as f32 / times.len() as f32);
        }
        let peak_time: Vec<usize> = (0..n)
            .map(|i| {
                let brightest = |best: usize, k: usize| {
                    if opacities[k][i] > opacities[best][i] { k } else { best }
                };
                (0..times.len()).fold(0, brightest)
            })
            .collect();
        let opacity_ranges = (0..n)
            .map(|i| {
                let peak = opacities[peak_time[i]][i];
                if broken[i] || peak.is_nan() {
                    OpacityRange::NEVER
                } else {
                    OpacityRange::of(peak)
                }
            })
            .collect();
        Ok(Self { times, edit, means, opacities, opacity_ranges, peak_time })
    }

    /// Number of splats.
    pub(crate) fn len(&self) -> usize {
        self.opacity_ranges.len()
    }

    /// Whether splat `i` is visible at key time `k`.
    pub(crate) fn is_visible(&self, k: usize, i: usize) -> bool {
        self.opacities[k][i] > self.opacity_ranges[i].floor
    }

    /// Presence of splat `i` at key time `k`, 0 to 1.
    pub(crate) fn presence(&self, k: usize, i: usize) -> f64 {
        self.opacity_ranges[i].presence(self.opacities[k][i])
    }

    /// Position of splat `i` at key time `k`, world units.
    pub(crate) fn position(&self, k: usize, i: usize) -> [f64; 3] {
        self.means[k][i].map(f64::from)
    }
}

/// Key times, ascending. They include the edit time and both ends; for a sequence they are frames.
fn key_times(source: &dyn DynamicScene, edit_time: f32, count: usize) -> Vec<f32> {
    let range = source.time_range();
    let mut times = match source.num_frames() {
        Some(frames) if frames <= count => range.frames(frames),
        Some(frames) => {
            let all = range.frames(frames);
            (0..count).map(|i| all[i * (frames - 1) / (count - 1)]).collect()
        }
        None => range.frames(count),
    };
    times.push(edit_time);
    times.sort_by(f32::total_cmp);
    times.dedup();
    times
}
