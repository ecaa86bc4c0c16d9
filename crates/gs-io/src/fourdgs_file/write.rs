//! Writing `.4dgs` files of the temporal model `gaussian-birth`.

use super::grid;
use super::segments::{Sample, Segment, Tolerance, split};
use crate::clip::{Clip, dropped_sentence, trimmed_diagonal};
use crate::error::IoError;
use crate::format_losses::FormatLosses;
use crate::fs::{AtomicFile, Existing};
use fourdgs::GaussianSet;
use gs_core::{Splats, quat, sh};
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;

/// Default of [`WriteOptions::tolerance`]: a fifth of a pixel if the scene is a thousand pixels
/// wide.
pub const DEFAULT_TOLERANCE: f64 = 2e-4;
/// Tolerances of rotation (radians, half a degree), logarithm of size (1 %), and of opacity and
/// colour (1.5 steps of 255): below what is visible.
const ROTATION: f32 = 0.0087;
const LOG_SCALE: f32 = 0.01;
const LEVEL: f32 = 1.5 / 255.0;
/// Rows are invisible where their fade is below this: half a step of 255.
const CUTOFF: f64 = 0.5 / 255.0;
/// Bound of the memory for frames, bytes. Larger clips are fitted in several passes.
const FRAMES_BYTES: usize = 512 << 20;
/// SH coefficients have this range, in 255 steps.
const SH_MAX: f32 = 4.0;

/// Options for writing.
#[derive(Debug, Clone, Copy)]
pub struct WriteOptions {
    /// Largest distance between a splat and its piecewise linear motion at the clip's frames, as a
    /// share of the scene's size (diagonal of the box of the middle 98 % of the first and last
    /// frames). Default [`DEFAULT_TOLERANCE`].
    pub tolerance: f64,
    /// SH above this degree are omitted. Default 3.
    pub sh_degree: usize,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { tolerance: DEFAULT_TOLERANCE, sh_degree: 3 }
    }
}

/// Result of writing a clip.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Splats of the scene that are visible in some frame.
    pub num_splats: usize,
    /// Rows of the file: segments of linear motion.
    pub num_rows: usize,
    /// Largest distance between a splat and its motion in the file before rounding, world units.
    pub distance: f64,
    /// Losses of the file.
    pub losses: FormatLosses,
}

/// Number of times that [`write()`] evaluates the scene: `progress` counts up to this.
pub fn evaluations(clip: &Clip<'_>) -> usize {
    3 + clip.times.len() * clip.scene.num_splats().div_ceil(rows_in_memory(clip)).max(1)
}

fn rows_in_memory(clip: &Clip<'_>) -> usize {
    (FRAMES_BYTES / (size_of::<Sample>() * clip.times.len().max(1))).max(1)
}

/// Writes the clip; it lasts the number of its frames divided by their rate. Each splat becomes one
/// row if it moves along a line and its opacity is constant or a Gaussian of time, else several
/// with consecutive windows. Memory besides one frame: at most 512 MiB of frames, and the rows.
///
/// # Errors
/// If there are no frames, splats or frames per second, the tolerance is out of range, no splat is
/// visible, the scene cannot be evaluated, or the file cannot be written.
pub fn write(
    path: &Path,
    clip: &Clip<'_>,
    options: &WriteOptions,
    existing: Existing,
    progress: &mut dyn FnMut(usize),
) -> Result<WriteReport, IoError> {
    clip.check(path)?;
    if !(options.tolerance > 0.0 && options.tolerance <= 1.0) {
        let what = format!("tolerance {}; expected above 0, at most 1", options.tolerance);
        return Err(IoError::content(path, what));
    }
    let mut file = AtomicFile::create(path, existing)?;
    let (num_splats, count) = (clip.scene.num_splats(), clip.times.len());
    let frame = |index: usize| {
        let evaluated = clip.scene.at(clip.times[index]);
        evaluated.map_err(|source| IoError::Scene { path: path.to_owned(), source })
    };
    let mut ends = frame(0)?.means;
    ends.extend(frame(count - 1)?.means);
    let middle = Harmonics::of(&frame(count / 2)?, options.sh_degree);
    progress(3);
    let tolerance = Tolerance {
        position: options.tolerance * trimmed_diagonal(&ends),
        rotation: ROTATION,
        log_scale: LOG_SCALE,
        level: LEVEL,
    };
    let clock = Clock { seconds: count as f64 / clip.fps, count };
    let mut rows = Rows::new(middle, clock);
    let (mut dropped, mut block, mut done) = (0, rows_in_memory(clip), 3);
    block = block.min(num_splats);
    for first in (0..num_splats).step_by(block) {
        let block = first..(first + block).min(num_splats);
        let mut samples: Vec<Vec<Sample>> = vec![Vec::with_capacity(count); block.len()];
        let mut valid = vec![true; block.len()];
        clip.each_frame(path, |_, splats| {
            rows.harmonics.add(splats, block.clone());
            let each = samples.par_iter_mut().zip(&mut valid).zip(block.clone());
            each.for_each(|((samples, valid), row)| {
                *valid &= splats.is_finite(row);
                samples.push(sample(splats, row));
            });
            done += 1;
            progress(done);
            Ok(())
        })?;
        dropped += valid.iter().filter(|&&valid| !valid).count();
        let found: Vec<Vec<Segment>> = samples
            .par_iter()
            .zip(&valid)
            .map(|(samples, &valid)| {
                let mut segments = Vec::new();
                if valid {
                    split(samples, &tolerance, &mut segments);
                }
                segments
            })
            .collect();
        for ((row, segments), samples) in block.zip(found).zip(&samples) {
            rows.push(row, &segments, samples);
        }
    }
    if rows.set.is_empty() {
        return Err(IoError::content(path, "no splat is visible in any frame; nothing to write"));
    }
    grid::snap(&mut rows.set, CUTOFF);
    let written = fourdgs::write_to_vec(
        &rows.set,
        clock.seconds,
        &fourdgs::WriteOptions {
            profile: grid::PROFILE,
            cutoff: CUTOFF,
            library: "c4d".to_owned(),
            ..fourdgs::WriteOptions::default()
        },
        &fourdgs::SceneExtras::default(),
    );
    let bytes = written.map_err(|error| {
        let what = format!(
            "cannot be written: {error}; remove splats that are far from the scene, or choose a different format"
        );
        IoError::content(path, what)
    })?;
    file.write_all(&bytes).map_err(IoError::write(path))?;
    file.commit()?;
    Ok(WriteReport {
        num_splats: rows.splats,
        num_rows: rows.set.count(),
        distance: rows.distance,
        losses: rows.losses(clip, options, dropped),
    })
}

fn sample(splats: &Splats, row: usize) -> Sample {
    Sample {
        mean: splats.means[row],
        quat: quat::normalize(splats.quats[row]),
        log_scale: splats.log_scales[row],
        opacity: splats.opacity(row),
        rgb: splats.sh_of(row)[0].map(|dc| 0.5 + sh::C0 * dc),
    }
}

/// Times of frames in seconds.
#[derive(Debug, Clone, Copy)]
struct Clock {
    seconds: f64,
    count: usize,
}

#[expect(clippy::cast_possible_truncation, reason = "times are stored in single precision")]
impl Clock {
    /// Seconds from one frame to the next; the last frame is at the end.
    fn step(self) -> f64 {
        self.seconds / (self.count.max(2) - 1) as f64
    }

    /// The window of some frames, from halfway to the frame before to halfway to the next.
    fn window(self, [first, last]: [usize; 2]) -> [f32; 2] {
        let edge = |frame: usize| ((frame as f64 - 0.5) * self.step()) as f32;
        let start = if first == 0 { 0.0 } else { edge(first) };
        // Windows are half-open; the last one contains all of the clip.
        let whole = (self.seconds as f32).next_up();
        [start, if last + 1 >= self.count { whole } else { edge(last + 1) }]
    }
}

/// Bytes of the SH above degree 0 in one frame.
struct Harmonics {
    degree: usize,
    /// Coefficients per channel and splat in the scene, and the number of them that are kept.
    stored: usize,
    kept: usize,
    frame: Vec<[f32; 3]>,
    /// Largest change of a kept coefficient.
    change: f32,
    /// Whether a kept coefficient is out of range.
    clipped: bool,
}

impl Harmonics {
    fn of(splats: &Splats, most: usize) -> Self {
        let degree = splats.sh_degree.min(most);
        Self {
            degree,
            stored: splats.sh_coeffs(),
            kept: sh::num_coeffs(degree) - 1,
            frame: splats.sh.clone(),
            change: 0.0,
            clipped: false,
        }
    }

    /// Updates the largest change of some rows.
    fn add(&mut self, splats: &Splats, rows: std::ops::Range<usize>) {
        if self.kept == 0 {
            return;
        }
        let (stored, kept, frame) = (self.stored, self.kept, &self.frame);
        let changes = rows.into_par_iter().map(|row| {
            let range = row * stored + 1..row * stored + 1 + kept;
            let pairs = splats.sh[range.clone()].iter().flatten();
            let pairs = pairs.zip(frame[range].iter().flatten());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        });
        self.change = self.change.max(changes.reduce(|| 0.0, f32::max));
    }

    /// The bytes of a row, all of red first, then green, then blue.
    fn push(&mut self, row: usize, out: &mut Vec<u8>) {
        let coefficients = &self.frame[row * self.stored + 1..][..self.kept];
        for channel in 0..3 {
            for coefficient in coefficients {
                let value = coefficient[channel];
                self.clipped |= value.abs() > SH_MAX;
                let level = (value + SH_MAX) * 255.0 / (2.0 * SH_MAX);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped to a byte"
                )]
                out.push((level + 0.5).clamp(0.0, 255.0) as u8);
            }
        }
    }
}

/// Rows of the file, and the losses of the conversion.
struct Rows {
    set: GaussianSet,
    harmonics: Harmonics,
    clock: Clock,
    splats: usize,
    distance: f64,
    /// Splats with a base colour that cannot be stored.
    clipped: usize,
}

impl Rows {
    fn new(harmonics: Harmonics, clock: Clock) -> Self {
        let mut set = GaussianSet::default();
        if harmonics.kept > 0 {
            set.sh = Some(Vec::new());
            set.sh_coefficients = harmonics.kept;
            set.sh_degree = u8::try_from(harmonics.degree).unwrap_or_default();
        }
        Self { set, harmonics, clock, splats: 0, distance: 0.0, clipped: 0 }
    }

    /// Adds the segments of a splat.
    #[expect(clippy::cast_possible_truncation, reason = "stored in single precision")]
    fn push(&mut self, row: usize, segments: &[Segment], samples: &[Sample]) {
        self.splats += usize::from(!segments.is_empty());
        let outside = |segment: &Segment| {
            segment.sample.rgb.iter().any(|value| !(-LEVEL..=1.0 + LEVEL).contains(value))
        };
        self.clipped += usize::from(segments.iter().any(outside));
        let step = self.clock.step();
        for segment in segments {
            let Sample { mean, quat: [w, x, y, z], log_scale, opacity, rgb } = segment.sample;
            for frame in segment.frames[0]..=segment.frames[1] {
                if samples[frame].opacity >= LEVEL {
                    let dt = frame as f64 - segment.centre;
                    let off = |k: usize| {
                        let at = f64::from(mean[k]) + segment.velocity[k] * dt;
                        (at - f64::from(samples[frame].mean[k])).powi(2)
                    };
                    self.distance = self.distance.max((off(0) + off(1) + off(2)).sqrt());
                }
            }
            self.set.positions.extend(mean);
            self.set.scales.extend(log_scale.map(f32::exp));
            self.set.rotations.extend([x, y, z, w]);
            self.set.colors.extend(rgb.map(|value| value.clamp(0.0, 1.0)));
            self.set.colors.push(opacity.clamp(0.0, 1.0));
            self.set.motions.extend(segment.velocity.map(|value| (value / step) as f32));
            self.set.mu_t.push((segment.centre * step) as f32);
            self.set.sigma_t.push((segment.sigma * step) as f32);
            let [start, end] = self.clock.window(segment.frames);
            self.set.win_lo.push(start);
            self.set.win_hi.push(end);
            if let Some(bytes) = &mut self.set.sh {
                self.harmonics.push(row, bytes);
            }
        }
    }

    fn losses(&self, clip: &Clip<'_>, options: &WriteOptions, dropped: usize) -> FormatLosses {
        let mut losses = FormatLosses::none();
        let (available, degree) = (clip.scene.sh_degree(), self.harmonics.degree);
        if degree < available {
            losses.push(format!("SH degree {available} becomes {degree}"));
        }
        losses.push(format!(
            "motion is linear in pieces, within {:.2e} scene units at every frame (at most {} of the scene's size)",
            self.distance, options.tolerance
        ));
        losses.push(
            "values are rounded: positions within 2 % of the median splat's size, sizes within 0.5 %, rotations within 0.0005 per component, colour and opacity within half of 255 steps",
        );
        if self.harmonics.kept > 0 {
            losses.push("SH above degree 0 have steps of 0.03");
        }
        if self.harmonics.change > SH_MAX / 255.0 {
            losses.push(format!(
                "SH above degree 0 are those of the middle frame; they change by up to {:.2}",
                self.harmonics.change
            ));
        }
        if self.harmonics.clipped {
            losses.push("SH above degree 0 are limited to ±4");
        }
        if self.clipped > 0 {
            losses.push(format!(
                "base colours outside the displayable range are clipped ({} splats)",
                self.clipped
            ));
        }
        if let Some(sentence) = dropped_sentence(dropped, clip.scene.num_splats()) {
            losses.push(sentence);
        }
        losses
    }
}
