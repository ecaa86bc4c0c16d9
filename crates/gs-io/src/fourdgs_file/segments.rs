//! Splits the life of one splat into segments of linear motion, constant shape and colour, and
//! opacity that is constant or a Gaussian of time: the rows of a `.4dgs` file.

use crate::opacity_fit::{ALWAYS, Sums};
use gs_core::image_formation::ALPHA_THRESHOLD;
use gs_core::quat;

/// A fade in fewer frames is not determined.
const MIN_FADE_FRAMES: usize = 4;

/// A splat in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    pub(super) mean: [f32; 3],
    /// Unit length.
    pub(super) quat: [f32; 4],
    pub(super) log_scale: [f32; 3],
    pub(super) opacity: f32,
    pub(super) rgb: [f32; 3],
}

/// Largest differences between a segment and the frames that it replaces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tolerance {
    /// Distance, world units.
    pub(super) position: f64,
    /// Angle, radians.
    pub(super) rotation: f32,
    /// Per axis, natural logarithm.
    pub(super) log_scale: f32,
    /// Of opacity and of colour channels, 0 to 1.
    pub(super) level: f32,
}

/// A splat during some frames. Times are frame indices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Segment {
    /// First and last frame.
    pub(super) frames: [usize; 2],
    /// Time at which the splat is at `sample.mean` and has its largest opacity.
    pub(super) centre: f64,
    /// World units per frame.
    pub(super) velocity: [f64; 3],
    /// Standard deviation of the fade, frames; infinite for none.
    pub(super) sigma: f64,
    pub(super) sample: Sample,
}

/// Appends the segments of a splat. Frames in which it is invisible have none.
pub(super) fn split(samples: &[Sample], tolerance: &Tolerance, out: &mut Vec<Segment>) {
    if let Some(last) = samples.len().checked_sub(1) {
        split_range(samples, [0, last], tolerance, out);
    }
}

fn split_range(
    samples: &[Sample],
    [first, last]: [usize; 2],
    tolerance: &Tolerance,
    out: &mut Vec<Segment>,
) {
    let visible: Vec<usize> =
        (first..=last).filter(|&frame| samples[frame].opacity >= ALPHA_THRESHOLD).collect();
    if visible.is_empty() {
        return;
    }
    if first == last {
        out.push(single(samples, first));
    } else if let Some(segment) = fit(samples, [first, last], &visible, tolerance) {
        out.push(segment);
    } else {
        let middle = usize::midpoint(first, last);
        split_range(samples, [first, middle], tolerance, out);
        split_range(samples, [middle + 1, last], tolerance, out);
    }
}

/// A segment of one frame. It moves as between the neighbouring frames.
fn single(samples: &[Sample], frame: usize) -> Segment {
    let shown = |frame: &usize| samples.get(*frame).is_some_and(|s| s.opacity >= ALPHA_THRESHOLD);
    let before = frame.checked_sub(1).filter(shown).unwrap_or(frame);
    let after = Some(frame + 1).filter(shown).unwrap_or(frame);
    let steps = (after - before).max(1) as f64;
    let [a, b] = [before, after].map(|frame| samples[frame].mean.map(f64::from));
    Segment {
        frames: [frame; 2],
        centre: frame as f64,
        velocity: [0, 1, 2].map(|k| (b[k] - a[k]) / steps),
        sigma: f64::INFINITY,
        sample: samples[frame],
    }
}

/// One segment for all frames of a range, if it is within the tolerance.
fn fit(
    samples: &[Sample],
    frames: [usize; 2],
    visible: &[usize],
    tolerance: &Tolerance,
) -> Option<Segment> {
    let reference = samples[visible[visible.len() / 2]];
    // The angle between quaternions is half the rotation angle.
    let least_dot = (0.5 * tolerance.rotation).cos();
    let off =
        |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let alike = visible.iter().all(|&frame| {
        let sample = &samples[frame];
        quat::dot(sample.quat, reference.quat).abs() >= least_dot
            && off(sample.log_scale, reference.log_scale) <= tolerance.log_scale
            && off(sample.rgb, reference.rgb) <= tolerance.level
    });
    if !alike {
        return None;
    }
    let line = Line::fit(samples, visible);
    let far = visible.iter().any(|&frame| {
        let (at, mean) = (line.at(frame as f64), samples[frame].mean);
        let squared: f64 = (0..3).map(|k| (at[k] - f64::from(mean[k])).powi(2)).sum();
        squared > tolerance.position * tolerance.position
    });
    if far {
        return None;
    }
    let fade = fade(samples, frames, tolerance.level)?;
    #[expect(clippy::cast_possible_truncation, reason = "stored in single precision")]
    let mean = line.at(fade.centre).map(|value| value as f32);
    Some(Segment {
        frames,
        centre: fade.centre,
        velocity: line.velocity,
        sigma: fade.sigma,
        sample: Sample { mean, opacity: fade.opacity, ..reference },
    })
}

struct Fade {
    centre: f64,
    sigma: f64,
    opacity: f32,
}

/// Opacity in a range of frames, constant or a Gaussian, if within the tolerance everywhere.
fn fade(samples: &[Sample], [first, last]: [usize; 2], tolerance: f32) -> Option<Fade> {
    let range = &samples[first..=last];
    let count = range.len() as f64;
    let middle = 0.5 * (first + last) as f64;
    let extreme = |pick: fn(f32, f32) -> f32, start| {
        range.iter().map(|sample| sample.opacity).fold(start, pick)
    };
    let (low, high) = (extreme(f32::min, 1.0), extreme(f32::max, 0.0));
    if high - low <= 2.0 * tolerance {
        let opacity = 0.5 * (low + high);
        return Some(Fade { centre: middle, sigma: f64::INFINITY, opacity });
    }
    if range.len() < MIN_FADE_FRAMES {
        return None;
    }
    let mut sums = Sums::default();
    let time = |index: usize| ((first + index) as f64 - middle) / count;
    for (index, sample) in range.iter().enumerate() {
        sums.add(time(index), f64::from(sample.opacity));
    }
    let found = sums.fit();
    if found.width >= ALWAYS {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, reason = "stored in single precision")]
    let opacity = found.opacity.min(1.0) as f32;
    let within = range.iter().enumerate().all(|(index, sample)| {
        let fading = (-((time(index) - found.centre) / found.width).powi(2)).exp();
        (f64::from(opacity) * fading - f64::from(sample.opacity)).abs() <= f64::from(tolerance)
    });
    within.then_some(Fade {
        centre: middle + found.centre * count,
        sigma: found.width * count * std::f64::consts::FRAC_1_SQRT_2,
        opacity,
    })
}

/// Motion along a line.
struct Line {
    middle: f64,
    mean: [f64; 3],
    velocity: [f64; 3],
}

impl Line {
    /// Least squares over the given frames.
    fn fit(samples: &[Sample], frames: &[usize]) -> Self {
        let count = frames.len() as f64;
        let middle = frames.iter().map(|&frame| frame as f64).sum::<f64>() / count;
        let (mut mean, mut moment, mut spread) = ([0.0; 3], [0.0; 3], 0.0);
        for &frame in frames {
            let t = frame as f64 - middle;
            spread += t * t;
            for k in 0..3 {
                let value = f64::from(samples[frame].mean[k]);
                mean[k] += value / count;
                moment[k] += t * value;
            }
        }
        let velocity = moment.map(|moment| if spread > 0.0 { moment / spread } else { 0.0 });
        Self { middle, mean, velocity }
    }

    fn at(&self, t: f64) -> [f64; 3] {
        [0, 1, 2].map(|k| self.mean[k] + self.velocity[k] * (t - self.middle))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Tolerance =
        Tolerance { position: 1e-3, rotation: 0.01, log_scale: 0.01, level: 0.004 };

    fn sample(mean: [f32; 3], opacity: f32) -> Sample {
        Sample { mean, quat: quat::IDENTITY, log_scale: [-3.0; 3], opacity, rgb: [0.5; 3] }
    }

    fn segments(samples: &[Sample]) -> Vec<Segment> {
        let mut out = Vec::new();
        split(samples, &TOLERANCE, &mut out);
        out
    }

    #[test]
    fn a_fading_splat_on_a_line_is_one_segment() {
        let samples: Vec<Sample> = (0..60_u8)
            .map(|i| {
                let t = f32::from(i);
                let fade = (-0.5 * ((t - 20.0) / 4.0).powi(2)).exp();
                sample([0.1 * t, 2.0, -0.2 * t], 0.7 * fade)
            })
            .collect();
        let [found] = segments(&samples)[..] else { panic!("one segment") };
        assert!(
            (found.centre - 20.0).abs() < 0.01 && (found.sigma - 4.0).abs() < 0.02,
            "{found:?}"
        );
        assert!((found.sample.mean[0] - 2.0).abs() < 2e-3, "where it is then: {found:?}");
        assert!((found.velocity[2] + 0.2).abs() < 1e-4, "per frame: {found:?}");
    }

    #[test]
    fn bends_and_jumps_are_split_and_invisible_frames_omitted() {
        let bend = |i: u8| sample([f32::from(i.abs_diff(16)), 0.0, 0.0], 0.9);
        let samples: Vec<Sample> = (0..32).map(bend).collect();
        let found = segments(&samples);
        assert!((2..=8).contains(&found.len()), "{}", found.len());
        assert_eq!(found.iter().map(|s| s.frames[1] - s.frames[0] + 1).sum::<usize>(), 32, "all");
        let blink = |i: u8| sample([0.0; 3], if i == 7 { 0.9 } else { 0.0 });
        let samples: Vec<Sample> = (0..32).map(blink).collect();
        let [found] = segments(&samples)[..] else { panic!("one frame") };
        assert_eq!((found.frames, found.sigma), ([7, 7], f64::INFINITY), "the visible one");
        assert!(segments(&[sample([0.0; 3], 0.001); 9]).is_empty(), "never visible");
        assert!(segments(&[]).is_empty(), "no frames");
    }
}
