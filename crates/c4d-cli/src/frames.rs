//! Times that a command processes, and their playback rate.

use crate::failure::{Failure, Outcome};
use crate::rates;
use crate::scene::LoadedScene;
use gs_core::{DynamicScene, TimeRange};

/// Default number of frames of a continuous scene.
pub(crate) const DEFAULT_FRAMES: usize = 60;
/// Default frame rate of scenes that do not store one.
const DEFAULT_FPS: f64 = 30.0;
/// Largest accepted number of frames; more are assumed to be a typing error.
const MAX_FRAMES: usize = 100_000;
/// Largest frame rate that players accept.
const MAX_FPS: f64 = 1000.0;
/// Longest clip, seconds: a day.
const MAX_SECS: f64 = 86_400.0;
/// Times that span the clip except for this share count as spanning the whole clip.
const WHOLE: f64 = 1e-4;

/// Flags about times and rate, as given.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Timing<'a> {
    /// `--times`; empty without.
    pub(crate) times: &'a [f32],
    /// `--frames`.
    pub(crate) frames: Option<usize>,
    /// `--fps`.
    pub(crate) fps: Option<f64>,
    /// `--duration`, seconds of the whole clip.
    pub(crate) duration: Option<f64>,
}

impl Timing<'_> {
    /// Refuses values out of range, and combinations in which two determine the third.
    pub(crate) fn check(&self) -> Outcome {
        if let Some(fps) = self.fps.filter(|&fps| !(fps > 0.0 && fps <= MAX_FPS)) {
            return Err(Failure::usage(format!(
                "--fps {fps}: expected above 0, at most {MAX_FPS}"
            )));
        }
        if let Some(secs) = self.duration.filter(|&secs| !(secs > 0.0 && secs <= MAX_SECS)) {
            return Err(Failure::usage(format!(
                "--duration {secs}: expected seconds, above 0, at most {MAX_SECS}"
            )));
        }
        let counted = self.frames.is_some() || !self.times.is_empty();
        if self.fps.is_some() && self.duration.is_some() && counted {
            let given = if self.frames.is_some() { "--frames" } else { "--times" };
            return Err(Failure::usage(format!(
                "{given}, --fps and --duration contradict each other: any two determine the third"
            ))
            .next("Omit one of them."));
        }
        Ok(())
    }

    /// The times given by `--times` or `--frames`, or by `--fps` and `--duration`; else the scene's
    /// stored frames, else [`DEFAULT_FRAMES`].
    pub(crate) fn times(&self, scene: &dyn DynamicScene) -> Outcome<Vec<f32>> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let filling = self.fps.zip(self.duration).map(|(fps, secs)| (fps * secs).round() as usize);
        times(scene, self.times, self.frames.or(filling.map(|count| count.max(1))))
    }

    /// Frames per second at which `times` last as long as their part of the clip, or `--fps`.
    pub(crate) fn fps(&self, opened: &LoadedScene, times: &[f32]) -> Outcome<f64> {
        let own = opened.fps.unwrap_or(DEFAULT_FPS);
        let stored = opened.scene.num_frames().unwrap_or(DEFAULT_FRAMES) as f64;
        let secs = self.duration.unwrap_or(stored / own);
        let fps = self.fps.or_else(|| rate(times, opened.scene.time_range(), secs)).unwrap_or(own);
        if fps <= MAX_FPS {
            return Ok(fps);
        }
        Err(Failure::usage(format!(
            "{} frames in {secs:.3} s are {fps:.0} per second, players accept at most {MAX_FPS}",
            times.len()
        ))
        .next("Use fewer frames, a longer --duration, or --fps."))
    }
}

/// Frames per second at which ascending `times` take their share of a clip of
/// `secs`; `None` if the times do not determine it.
fn rate(times: &[f32], range: TimeRange, secs: f64) -> Option<f64> {
    let (first, last) = (f64::from(*times.first()?), f64::from(*times.last()?));
    let share = (last - first) / (f64::from(range.end) - f64::from(range.start));
    if times.len() < 2 || !times.is_sorted_by(|a, b| a < b) {
        return None;
    }
    let count = times.len() as f64;
    // In a whole clip every frame has the same duration, including the last.
    Some(if share > 1.0 - WHOLE { count / secs } else { (count - 1.0) / (share * secs) })
}

/// The times given by `--times` or `--frames`, else the scene's
/// stored frames, else [`DEFAULT_FRAMES`].
pub(crate) fn times(
    scene: &dyn DynamicScene,
    times: &[f32],
    frames: Option<usize>,
) -> Outcome<Vec<f32>> {
    let range = scene.time_range();
    if !times.is_empty() {
        for &t in times {
            check(range, t, "--times")?;
        }
        return Ok(times.to_vec());
    }
    let count = frames.or(scene.num_frames()).unwrap_or(DEFAULT_FRAMES);
    if count == 0 || count > MAX_FRAMES {
        return Err(Failure::usage(format!("--frames {count}: expected 1 to {MAX_FRAMES}")));
    }
    Ok(range.frames(count))
}

/// Number of frames, their rate and their duration, as text.
pub(crate) fn playing(frames: usize, fps: f64) -> String {
    if frames == 1 {
        return "one frame".to_owned();
    }
    let secs = frames as f64 / fps;
    format!("{frames} frames at {} per second, {secs:.1} s", rates::rounded(fps))
}

/// Refuses a time outside the scene.
pub(crate) fn check(range: TimeRange, t: f32, flag: &str) -> Outcome {
    if range.contains(t) {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{flag} {t} is outside the scene's times, {} to {}",
        range.start, range.end
    ))
    .next(format!(
        "Times are normalised: {} is the first frame, {} the last, the others are evenly spaced.",
        range.start, range.end
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_number_of_frames_lasts_as_long_as_the_clip() {
        let range = TimeRange { start: 0.0, end: 0.8 };
        for count in [2, 7, 30, 60, 240] {
            let fps = rate(&range.frames(count), range, 2.0).unwrap();
            assert!((count as f64 / fps - 2.0).abs() < 1e-9, "{count} frames: {fps}");
        }
        let part = rate(&[0.0, 0.2, 0.4], range, 2.0).unwrap();
        assert!((part - 2.0).abs() < 1e-6, "half of the clip in half of its time: {part}");
        for times in [&[0.4, 0.2][..], &[0.1], &[0.3, 0.3], &[]] {
            assert_eq!(rate(times, range, 2.0), None, "{times:?}");
        }
    }
}
