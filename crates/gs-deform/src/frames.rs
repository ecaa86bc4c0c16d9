//! Frames at evenly spaced times, and interpolation between them.

use gs_core::{SceneError, Splats, TimeRange, quat};
use rayon::prelude::*;
use std::borrow::Borrow;

/// Gaussians per task.
const CHUNK: usize = 4096;

/// Evaluates a scene of `n ≥ 1` frames at times `i/(n−1)` at time `t`: a frame as returned by
/// `frame`, or a blend of two (means, log-scales, logits and SH linearly, rotations by normalised
/// linear interpolation). `geometry_only` leaves logits and SH of `out` unchanged.
///
/// # Errors
/// If `t` lies outside [0, 1], or `frame` fails.
///
/// # Panics
/// If frames differ in size or SH degree.
pub fn evaluate<F: Borrow<Splats>>(
    n: usize,
    t: f32,
    geometry_only: bool,
    out: &mut Splats,
    frame: impl Fn(usize) -> Result<F, SceneError>,
) -> Result<(), SceneError> {
    let range = TimeRange::UNIT;
    if !range.contains(t) {
        return Err(SceneError::Time { t, range });
    }
    match position(t, n) {
        Position::At(i) => copy(frame(i)?.borrow(), geometry_only, out),
        Position::Between(i, fraction) => {
            blend(frame(i)?.borrow(), frame(i + 1)?.borrow(), fraction, geometry_only, out);
        }
    }
    Ok(())
}

/// Position of a time among `n` frames at `i/(n−1)`.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Position {
    /// On frame `i`.
    At(usize),
    /// Between frames `i` and `i + 1`, this fraction of the way.
    Between(usize, f32),
}

/// Position of `t`, 0 to 1, among `n ≥ 1` frames. Single-precision times of frames
/// (`TimeRange::frames`) are recognised exactly.
fn position(t: f32, n: usize) -> Position {
    let last = n.saturating_sub(1);
    if last == 0 {
        return Position::At(0);
    }
    let exact = f64::from(t.clamp(0.0, 1.0)) * last as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and the number of frames; NaN becomes 0"
    )]
    let index = |value: f64| (value as usize).min(last);
    let nearest = index(exact.round());
    #[expect(clippy::cast_possible_truncation, reason = "scene times are single precision")]
    let frame_time = (nearest as f64 / last as f64) as f32;
    if frame_time == t {
        return Position::At(nearest);
    }
    let low = index(exact.floor()).min(last - 1);
    #[expect(clippy::cast_possible_truncation, reason = "a fraction")]
    let fraction = (exact - low as f64) as f32;
    Position::Between(low, fraction)
}

/// Blends two frames with the same rows: means, log-scales, logits and SH
/// linearly, rotations by normalised linear interpolation on one hemisphere.
/// `geometry_only` leaves logits and SH of `out` unchanged.
///
/// # Panics
/// If the frames differ in size or SH degree.
fn blend(a: &Splats, b: &Splats, fraction: f32, geometry_only: bool, out: &mut Splats) {
    assert_eq!((a.len(), a.sh_degree), (b.len(), b.sh_degree), "frames have the same rows");
    rows(&a.means, &b.means, &mut out.means, |x, y| mix(x, y, fraction));
    rows(&a.log_scales, &b.log_scales, &mut out.log_scales, |x, y| mix(x, y, fraction));
    rows(&a.quats, &b.quats, &mut out.quats, |x, y| {
        // Stored quaternions have any length; the interpolation must not depend on it.
        let (x, y) = (quat::normalize(x), quat::normalize(y));
        quat::normalize(mix(x, quat::align(y, x), fraction))
    });
    if !geometry_only {
        rows(&a.opacity_logits, &b.opacity_logits, &mut out.opacity_logits, |x, y| {
            mix([x], [y], fraction)[0]
        });
        rows(&a.sh, &b.sh, &mut out.sh, |x, y| mix(x, y, fraction));
        out.sh_degree = a.sh_degree;
    }
}

/// Copies a frame; `geometry_only` leaves logits and SH of `out` unchanged.
fn copy(from: &Splats, geometry_only: bool, out: &mut Splats) {
    if geometry_only {
        out.means.clone_from(&from.means);
        out.quats.clone_from(&from.quats);
        out.log_scales.clone_from(&from.log_scales);
    } else {
        out.clone_from(from);
    }
}

/// Time of frame `i` of `n`.
pub fn time_of(i: usize, n: usize) -> f32 {
    TimeRange::UNIT.frames(n).get(i).copied().unwrap_or(0.0)
}

/// `(1−f)·x + f·y`: exact for equal ends, also infinite ones, unlike `x + f·(y−x)`.
fn mix<const D: usize>(x: [f32; D], y: [f32; D], fraction: f32) -> [f32; D] {
    std::array::from_fn(
        |k| if x[k] == y[k] { x[k] } else { (1.0 - fraction) * x[k] + fraction * y[k] },
    )
}

fn rows<T: Copy + Default + Send + Sync>(
    a: &[T],
    b: &[T],
    out: &mut Vec<T>,
    blend: impl Fn(T, T) -> T + Sync,
) {
    out.resize(a.len(), T::default());
    out.par_chunks_mut(CHUNK).zip(a.par_chunks(CHUNK)).zip(b.par_chunks(CHUNK)).for_each(
        |((out, a), b)| {
            for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
                *out = blend(a, b);
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_times_are_recognised() {
        for n in [1, 2, 3, 7, 300, 1001] {
            for (i, t) in TimeRange::UNIT.frames(n).into_iter().enumerate() {
                assert_eq!(position(t, n), Position::At(i), "frame {i} of {n}");
                assert_eq!(time_of(i, n), t, "time of frame {i} of {n}");
            }
        }
    }

    #[test]
    fn times_between_frames_are_fractions() {
        assert_eq!(position(0.375, 5), Position::Between(1, 0.5), "half way");
        let Position::Between(low, fraction) = position(1.0_f32.next_down(), 5) else {
            panic!("just before the end is not a frame");
        };
        assert!(low == 3 && fraction <= 1.0, "{low} {fraction}");
    }
}
