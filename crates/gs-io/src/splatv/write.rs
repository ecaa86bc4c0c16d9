//! Writing `.splatv`: cubic polynomials fitted by least squares, with the errors of the fit.

use super::fit::{Basis, shifted};
use super::row::{BYTES, Row, level};
use crate::clip::{Clip, Hemispheres, ValidRows, dropped_sentence, trimmed_diagonal};
use crate::content::magic::SPLATV;
use crate::error::IoError;
use crate::format_losses::FormatLosses;
use crate::fs::{AtomicFile, Existing};
use crate::opacity_fit::{ALWAYS, Sums as FadeSums};
use crate::repair;
use gs_core::{Camera, DynamicScene, Splats, nearest_rank, quat, sh};
use gs_deform::{Polynomial, PolynomialScene};
use half::f16;
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;

/// Number of passes over the frames of a clip: `progress` of [`write()`]
/// counts up to this many times their number.
pub const PASSES: usize = 2;

/// Default of [`WriteOptions::tolerance`].
pub const DEFAULT_TOLERANCE: f64 = 0.005;

/// Splats per row of the texture.
const SPLATS_PER_ROW: usize = 1024;

/// Options for writing.
#[derive(Debug, Clone)]
pub struct WriteOptions {
    /// Largest position error exceeded by at most one splat in a hundred, as a share of the scene's
    /// size (diagonal of the box of the middle 98 % of the first and last frames); the clip is
    /// rejected above it. Default [`DEFAULT_TOLERANCE`].
    pub tolerance: f64,
    /// Write the file regardless of the errors of the fit. Default false.
    pub force: bool,
    /// The initial camera of players; errors are reported in its pixels.
    pub camera: Camera,
    /// The scene's upward direction, world frame: read back by this crate only.
    pub up: [f64; 3],
}

/// Errors of a fit: mean over splats and frames, 99th percentile over splats, and largest.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Misfit {
    /// Mean over all splats and frames.
    pub mean: f64,
    /// 99th percentile over splats of each splat's largest error.
    pub p99: f64,
    /// Largest error.
    pub max: f64,
}

/// Result of writing a clip.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Splats written.
    pub num_splats: usize,
    /// Distance between the scene's centres and those in the file, world units.
    pub distance: Misfit,
    /// The same in pixels of the camera, without splats behind it.
    pub pixels: Misfit,
    /// Angle between the scene's rotations and those in the file, degrees.
    pub degrees: Misfit,
    /// Losses of the file.
    pub losses: FormatLosses,
}

/// Writes the clip with its times scaled to 0 … 1. The scene is evaluated [`PASSES`] times per
/// frame; `progress` is called with the number of finished evaluations. Memory besides one frame:
/// about 500 bytes per splat, for any number of frames.
///
/// # Errors
/// If there are no frames, splats or frames per second, the tolerance is not a positive number, the
/// error of the fit exceeds it, a splat moves too far for 16-bit numbers, the scene cannot be
/// evaluated, or the file cannot be written.
pub fn write(
    path: &Path,
    clip: &Clip<'_>,
    options: &WriteOptions,
    existing: Existing,
    progress: &mut dyn FnMut(usize),
) -> Result<WriteReport, IoError> {
    clip.check(path)?;
    if !(options.tolerance.is_finite() && options.tolerance > 0.0) {
        return Err(IoError::content(
            path,
            format!("tolerance {}; expected a positive number", options.tolerance),
        ));
    }
    let mut file = AtomicFile::create(path, existing)?;

    let last = clip.times.len().saturating_sub(1).max(1) as f64;
    let times: Vec<f64> = (0..clip.times.len()).map(|i| i as f64 / last - 0.5).collect();
    let basis = Basis::new(&times);
    let mut sums = vec![Sums::default(); clip.scene.num_splats()];
    let mut valid = ValidRows::new(clip.scene.num_splats());
    let mut hemispheres = Hemispheres::default();
    let mut ends = Vec::new();
    clip.each_frame(path, |index, splats| {
        if index == 0 || index + 1 == clip.times.len() {
            ends.extend_from_slice(&splats.means);
        }
        hemispheres.follow(splats);
        valid.add(splats);
        let weights = basis.weights(index);
        sums.par_iter_mut().enumerate().for_each(|(row, sums)| {
            sums.add(splats, hemispheres.get(row), row, times[index], weights);
        });
        progress(index + 1);
        Ok(())
    })?;
    let kept = valid.rows(path)?;
    let means: [f64; 4] = std::array::from_fn(|power| {
        let power = i32::try_from(power).unwrap_or(0);
        times.iter().map(|t| t.powi(power)).sum::<f64>() / times.len() as f64
    });
    let rows: Vec<Row> = kept.par_iter().map(|&row| sums[row].row(&basis, means)).collect();
    drop(sums);
    if let Some(index) = rows.iter().position(Row::is_damaged) {
        return Err(IoError::content(
            path,
            format!(
                "splat {} moves or rotates too far for the format's 16-bit numbers; shorten the \
                clip",
                kept[index]
            ),
        ));
    }

    let misfit = measure(path, clip, &options.camera, &kept, &rows, progress)?;
    let size = trimmed_diagonal(&ends);
    if misfit.distance.p99 > options.tolerance * size && !options.force {
        return Err(IoError::Unfit {
            path: path.to_owned(),
            what: format!(
                "cubic polynomials do not fit this motion: for one splat in a hundred the error \
                exceeds {:.2} % of the scene's size ({:.1} pixels), the limit is {} %; a shorter \
                clip may fit",
                100.0 * misfit.distance.p99 / size,
                misfit.pixels.p99,
                100.0 * options.tolerance
            ),
        });
    }

    let height = rows.len().div_ceil(SPLATS_PER_ROW);
    let header = header(options, height).to_string();
    let length = u32::try_from(header.len()).unwrap_or(u32::MAX);
    let mut write = |bytes: &[u8]| file.write_all(bytes).map_err(IoError::write(path));
    write(&SPLATV)?;
    write(&length.to_le_bytes())?;
    write(header.as_bytes())?;
    rows.iter().try_for_each(|row| write(&row.to_bytes()))?;
    write(&vec![0; (height * SPLATS_PER_ROW - rows.len()) * BYTES])?;
    file.commit()?;
    Ok(WriteReport {
        num_splats: rows.len(),
        distance: misfit.distance,
        pixels: misfit.pixels,
        degrees: misfit.degrees,
        losses: losses(clip, &misfit, rows.len()),
    })
}

/// Running sums of one splat.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// Sums of coordinates, by axis, times the basis.
    mean: [[f64; 4]; 3],
    /// Sums of quaternion components times the basis.
    quat: [[f64; 4]; 4],
    log_scale: [f64; 3],
    dc: [f64; 3],
    fade: FadeSums,
    count: f64,
}

impl Sums {
    fn add(&mut self, splats: &Splats, quat: [f32; 4], row: usize, t: f64, weights: [f64; 4]) {
        let project = |sums: &mut [f64; 4], value: f32| {
            sums.iter_mut()
                .zip(weights)
                .for_each(|(sum, weight)| *sum += weight * f64::from(value));
        };
        for k in 0..3 {
            project(&mut self.mean[k], splats.means[row][k]);
            self.log_scale[k] += f64::from(splats.log_scales[row][k]);
            self.dc[k] += f64::from(splats.sh_of(row)[0][k]);
        }
        for k in 0..4 {
            project(&mut self.quat[k], quat[k]);
        }
        self.fade.add(t, f64::from(splats.opacity(row)));
        self.count += 1.0;
    }

    /// The splat as it will be stored; `means` are the mean powers of time.
    fn row(&self, basis: &Basis, means: [f64; 4]) -> Row {
        let fade = self.fade.fit();
        let half = |value: f64| f16::from_f64(value).to_f64();
        let centre = half(fade.centre + 0.5) - 0.5;
        // Mean powers of the time relative to the splat's own centre.
        let powers = [
            1.0,
            means[1] - centre,
            means[2] - 2.0 * centre * means[1] + centre * centre,
            means[3] - 3.0 * centre * means[2] + 3.0 * centre * centre * means[1] - centre.powi(3),
        ];
        let (mut mean, mut velocity) = ([0.0; 3], [[0.0_f32; 3]; 3]);
        for k in 0..3 {
            let exact = shifted(basis.coefficients(self.mean[k], 3), centre);
            // The constant compensates the rounding of the velocities on average.
            let mut constant = exact[0];
            for power in 1..4 {
                constant += (exact[power] - half(exact[power])) * powers[power];
                velocity[power - 1][k] = single(half(exact[power]));
            }
            mean[k] = single(constant);
        }
        let quat_powers: [[f64; 4]; 4] =
            self.quat.map(|sums| shifted(basis.coefficients(sums, 1), centre));
        let length = quat_powers.iter().map(|q| q[0] * q[0]).sum::<f64>().sqrt().max(1e-6);
        let stored = |value: f64| single(half(value));
        Row {
            mean,
            quat: quat_powers.map(|q| stored(q[0] / length)),
            scale: self.log_scale.map(|sum| stored((sum / self.count).exp().min(65504.0))),
            rgba: {
                let [r, g, b] =
                    self.dc.map(|sum| level(0.5 + f64::from(sh::C0) * sum / self.count));
                [r, g, b, level(fade.opacity)]
            },
            motion: Polynomial {
                velocity,
                omega: quat_powers.map(|q| stored(q[1] / length)),
                centre: stored(centre + 0.5),
                width: stored(fade.width.clamp(1e-4, ALWAYS)),
            },
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "files hold single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Errors of the fit.
#[derive(Debug, Default)]
struct Measured {
    distance: Misfit,
    pixels: Misfit,
    degrees: Misfit,
    /// Largest relative error of a size.
    scale: f64,
    /// Largest error of a colour channel, share of 255.
    rgb: f64,
    opacity: Misfit,
}

/// Errors of one splat at one time: distance, pixels, degrees, logarithm of size, colour, opacity.
type Errors = [f32; 6];

fn measure(
    path: &Path,
    clip: &Clip<'_>,
    camera: &Camera,
    kept: &[usize],
    rows: &[Row],
    progress: &mut dyn FnMut(usize),
) -> Result<Measured, IoError> {
    let mut rest = Splats::with_capacity(rows.len(), 0);
    for row in rows {
        rest.means.push(row.mean);
        rest.quats.push(row.quat);
        rest.log_scales.push(row.log_scale());
        rest.opacity_logits.push(row.opacity_logit());
        rest.sh.push(row.sh_dc());
    }
    repair::replace_infinities(&mut rest);
    let motions = rows.iter().map(|row| row.motion).collect();
    let scene = PolynomialScene::new(rest, motions)
        .map_err(|error| IoError::content(path, error.to_string()))?;
    let steps = clip.times.len().saturating_sub(1).max(1) as f64;
    let mut worst = vec![[0.0_f32; 6]; rows.len()];
    let mut totals = [0.0_f64; 6];
    let mut fitted = Splats::default();
    clip.each_frame(path, |index, truth| {
        // A single frame is fitted at the middle of time, like all constant values.
        let t = if clip.times.len() == 1 { 0.0 } else { single(index as f64 / steps) };
        scene
            .at_into(t, &mut fitted)
            .map_err(|source| IoError::Scene { path: path.to_owned(), source })?;
        let errors: Vec<Errors> = kept
            .par_iter()
            .enumerate()
            .map(|(index, &row)| errors_of(truth, row, &fitted, index, camera))
            .collect();
        for (worst, errors) in worst.iter_mut().zip(errors) {
            for (k, error) in errors.into_iter().enumerate() {
                worst[k] = worst[k].max(error);
                totals[k] += f64::from(error);
            }
        }
        progress(clip.times.len() + index + 1);
        Ok(())
    })?;
    let samples = (rows.len() * clip.times.len()) as f64;
    let misfit = |k: usize| {
        let mut values: Vec<f32> = worst.iter().map(|worst| worst[k]).collect();
        let p99 = nearest_rank(&mut values, 0.99).unwrap_or(0.0);
        Misfit { mean: totals[k] / samples, p99: p99.into(), max: largest(&worst, k) }
    };
    Ok(Measured {
        distance: misfit(0),
        pixels: misfit(1),
        degrees: misfit(2),
        scale: largest(&worst, 3).exp_m1(),
        rgb: largest(&worst, 4),
        opacity: misfit(5),
    })
}

fn largest(worst: &[Errors], k: usize) -> f64 {
    worst.iter().map(|worst| worst[k]).fold(0.0, f32::max).into()
}

fn errors_of(truth: &Splats, row: usize, fitted: &Splats, index: usize, camera: &Camera) -> Errors {
    let (a, b) = (truth.means[row].map(f64::from), fitted.means[index].map(f64::from));
    let distance = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    let pixels = camera.project(a).zip(camera.project(b)).map_or(0.0, |(a, b)| {
        let [dx, dy] = [a[0] - b[0], a[1] - b[1]];
        dx.hypot(dy)
    });
    let (p, q) = (truth.rotation(row).map(f64::from), fitted.rotation(index).map(f64::from));
    // The sine of half the angle, which is accurate for small angles.
    let q = quat::align(q, p);
    let chord = (0..4).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
    let degrees = (4.0 * (chord / 2.0).min(1.0).asin()).to_degrees();
    let widest = |values: [f32; 3]| values.into_iter().map(f32::abs).fold(0.0, f32::max);
    let scale = widest([0, 1, 2].map(|k| truth.log_scales[row][k] - fitted.log_scales[index][k]));
    let rgb = |splats: &Splats, row: usize, k: usize| {
        (0.5 + sh::C0 * splats.sh_of(row)[0][k]).clamp(0.0, 1.0)
    };
    let colour = widest([0, 1, 2].map(|k| rgb(truth, row, k) - rgb(fitted, index, k)));
    let opacity = (truth.opacity(row) - fitted.opacity(index)).abs();
    [single(distance), single(pixels), single(degrees), scale, colour, opacity]
}

fn losses(clip: &Clip<'_>, misfit: &Measured, written: usize) -> FormatLosses {
    let mut losses = FormatLosses::none();
    let degree = clip.scene.sh_degree();
    if degree > 0 {
        losses.push(format!("SH degree {degree} becomes 0: colour no longer depends on the view"));
    }
    let Measured { distance, pixels, degrees, .. } = misfit;
    losses.push(format!(
        "motion becomes one cubic polynomial per splat: error {:.2e} scene units ({:.2} pixels) \
        on average, {:.2e} ({:.2}) at the 99th percentile, {:.2e} ({:.2}) at most",
        distance.mean, pixels.mean, distance.p99, pixels.p99, distance.max, pixels.max
    ));
    losses.push(format!(
        "rotation becomes linear in time: error {:.2}° on average, {:.1}° at the 99th percentile, \
        {:.1}° at most",
        degrees.mean, degrees.p99, degrees.max
    ));
    losses.push(format!(
        "sizes and colours become constant: errors at most {:.1} % and {:.0} of 255 steps",
        100.0 * misfit.scale,
        255.0 * misfit.rgb
    ));
    losses.push(format!(
        "opacity becomes constant or one Gaussian in time: error {:.3} on average, {:.2} at the \
        99th percentile, {:.2} at most",
        misfit.opacity.mean, misfit.opacity.p99, misfit.opacity.max
    ));
    losses.push("the format has no frame rate: players choose the playback speed");
    if let Some(sentence) =
        dropped_sentence(clip.scene.num_splats() - written, clip.scene.num_splats())
    {
        losses.push(sentence);
    }
    losses
}

fn header(options: &WriteOptions, height: usize) -> serde_json::Value {
    let camera = &options.camera;
    let v = &camera.viewmat;
    let rotation: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|k| v[k][i]));
    serde_json::json!([{
        "type": "splat",
        "size": height * SPLATS_PER_ROW * BYTES,
        "texwidth": 4 * SPLATS_PER_ROW,
        "texheight": height,
        "c4d_up": options.up,
        "cameras": [{
            "id": 0,
            "img_name": camera.name,
            "width": camera.width,
            "height": camera.height,
            "position": camera.position(),
            "rotation": rotation,
            "fx": camera.intrinsics.fx,
            "fy": camera.intrinsics.fy,
        }],
    }])
}
