//! Quality of the fit with known ground truth: the demo scene's edit, evaluated at views between
//! the given ones.
//!
//! `cargo run --release --workspace --example fit_demo [CASE …]`; without a case, all. With
//! `--motion`, the fitted splats are also propagated.
//! [docs/BENCHMARKS.md](../../../../docs/BENCHMARKS.md) has the results.

#![expect(clippy::print_stdout, reason = "prints its results")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "pixels of small pictures"
)]

mod motion;

use gs_core::{Camera, Image, Rasterizer, RenderParams, Splats};
use gs_fit::mask::{difference_mask, dilated};
use gs_fit::{EditedPicture, FitObserver, FitOptions, FitProgress, Fitted, fit};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, Edit, Part, Region, apply_edits, demo, demo_edits};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::error::Error;
use std::time::Instant;

/// Independent differences between the pictures inside the edit.
#[derive(Debug, Clone, Copy)]
enum Disagreement {
    /// No differences.
    None,
    /// Gain σ 0.15, offset σ 0.04 per channel, shift σ 2 pixels.
    Jitter,
    /// A smooth warp of σ 2 pixels and a texture of σ 0.05.
    Detail,
}

/// A row of the table.
#[derive(Debug, Clone, Copy)]
struct Case {
    name: &'static str,
    splats: usize,
    views: usize,
    side: u32,
    steps: usize,
    disagreement: Disagreement,
    /// Whether to align the pictures.
    align: bool,
}

const AGREE: Case = Case {
    name: "agree",
    splats: 30_000,
    views: 24,
    side: 400,
    steps: 800,
    disagreement: Disagreement::None,
    align: true,
};
const JITTER: Case =
    Case { name: "jitter", side: 320, steps: 600, disagreement: Disagreement::Jitter, ..AGREE };
const DETAIL: Case = Case { name: "detail", disagreement: Disagreement::Detail, ..JITTER };

const CASES: [Case; 7] = [
    AGREE,
    Case { name: "eight", views: 8, side: 320, steps: 300, ..AGREE },
    JITTER,
    Case { name: "jitter-plain", align: false, ..JITTER },
    DETAIL,
    Case { name: "detail-plain", align: false, ..DETAIL },
    Case { name: "large", splats: 100_000, side: 512, steps: 1000, ..AGREE },
];

/// Prints the progress at intervals.
#[derive(Debug)]
struct Lines;

impl FitObserver for Lines {
    fn progress(&mut self, now: &FitProgress) {
        if now.done.is_multiple_of(200) {
            eprintln!(
                "  step {} loss {:.5} splats {}",
                now.done,
                now.loss.unwrap_or(0.0),
                now.splats
            );
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    println!(
        "| case | views | steps | before all / inside | after all / inside | outside | ball left | splats | s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let named: Vec<&String> = arguments.iter().filter(|a| !a.starts_with('-')).collect();
    for case in
        CASES.iter().filter(|case| named.is_empty() || named.iter().any(|a| *a == case.name))
    {
        let params =
            DemoParams { seed: 7, sh_degree: 0, num_splats: case.splats, ..DemoParams::default() };
        let scene = demo(&params)?;
        let edit = apply_edits(&scene, &demo_edits(), 7)?;
        let edited = &edit.splats;
        let start = scene.frame1();
        let cameras = ring(&scene.orbit_cameras(1, case.side, case.side)[0], case.views, 0.0);
        let mut pictures = pictures_of(&cameras, edited)?;
        disagree(&mut pictures, start, case.disagreement)?;
        let options = FitOptions { steps: case.steps, align: case.align, ..FitOptions::default() };
        let began = Instant::now();
        let fitted = fit(&CpuRasterizer::default(), start, &pictures, &options, None, &mut Lines)?;
        let secs = began.elapsed().as_secs_f64();
        let held_out = ring(&scene.orbit_cameras(1, case.side, case.side)[0], 6, 0.3);
        let before = judge(&held_out, start, edited, start)?;
        let after = judge(&held_out, &fitted.splats, edited, start)?;
        println!(
            "| {} | {} × {}² | {} | {:.2} / {:.2} | {:.2} / {:.2} | {:.1} | {:.2} % | {} | {secs:.0} |",
            case.name,
            case.views,
            case.side,
            case.steps,
            before[0],
            before[1],
            after[0],
            after[1],
            after[2],
            100.0 * ball(&scene, &held_out, &fitted, start)?,
            fitted.splats.len()
        );
        if arguments.iter().any(|a| a == "--motion") {
            let is_fitted: Vec<bool> = fitted
                .source_rows
                .iter()
                .map(|row| row.is_none_or(|row| fitted.selected[row as usize]))
                .collect();
            let both = motion::end_points(&scene, &edit, (&fitted.splats, &is_fitted), &cameras)?;
            for (name, errors) in ["true edit", "fitted edit"].iter().zip(both) {
                println!(
                    "{name}, propagated: end-point error {:.4} % of the figure's size (95th percentile {:.4} %), {} splats, {:.0} % in place",
                    errors.mean, errors.p95, errors.count, errors.kept
                );
            }
        }
    }
    Ok(())
}

/// Views around the scene at three heights.
fn ring(first: &Camera, count: usize, phase: f64) -> Vec<Camera> {
    let eye = first.position();
    let forward = first.viewmat[2];
    let distance = (eye[0].powi(2) + eye[1].powi(2) + eye[2].powi(2)).sqrt();
    // the target lies on the axis of the first view, at the height of the figure's middle
    let along = (eye[0] * forward[0] + eye[2] * forward[2]).abs()
        / (forward[0].powi(2) + forward[2].powi(2));
    let target = [0, 1, 2].map(|k| eye[k] + along * forward[k]);
    let reach = distance.max((0..3).map(|k| (eye[k] - target[k]).powi(2)).sum::<f64>().sqrt());
    (0..count)
        .map(|i| {
            let angle = std::f64::consts::TAU * (i as f64 + phase) / count as f64;
            let lift: f64 = [0.1, 0.35, 0.6][i % 3];
            let eye = [
                target[0] + reach * angle.sin() * lift.cos(),
                target[1] + reach * lift.sin(),
                target[2] + reach * angle.cos() * lift.cos(),
            ];
            let mut camera =
                Camera::look_at(eye, target, [0.0, 1.0, 0.0], 0.52, first.width, first.height);
            camera.name = format!("view_{i:02}");
            camera
        })
        .collect()
}

fn render(camera: &Camera, splats: &Splats) -> Result<Image, Box<dyn Error>> {
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(splats, camera)?;
    Ok(raster.forward(&mut prepared, splats, &[], &RenderParams::default())?.rgb_image())
}

fn pictures_of(cameras: &[Camera], splats: &Splats) -> Result<Vec<EditedPicture>, Box<dyn Error>> {
    cameras
        .iter()
        .map(|camera| {
            let mut image = render(camera, splats)?;
            for value in &mut image.data {
                *value = (value.clamp(0.0, 1.0) * 255.0).round() / 255.0;
            }
            Ok(EditedPicture { camera: camera.clone(), image, mask: None })
        })
        .collect()
}

fn normal(rng: &mut Pcg64) -> f32 {
    let (u, v) = (rng.random(), rng.random());
    gs_core::standard_normal(u, v)
}

/// Smooth noise of unit variance: waves of random direction and phase with wavelengths of about
/// `wavelength` pixels.
fn waves(rng: &mut Pcg64, wavelength: f32) -> impl Fn(f32, f32) -> f32 + use<> {
    let list: Vec<[f32; 3]> = (0..12)
        .map(|_| {
            let k = std::f32::consts::TAU / (wavelength * (0.7 + 0.8 * rng.random::<f32>()));
            let (sin, cos) = (std::f32::consts::TAU * rng.random::<f32>()).sin_cos();
            [k * cos, k * sin, std::f32::consts::TAU * rng.random::<f32>()]
        })
        .collect();
    move |x, y| list.iter().map(|[a, b, c]| (a * x + b * y + c).sin()).sum::<f32>() / 6.0_f32.sqrt()
}

/// Adds independent differences to every picture inside the edit.
fn disagree(
    pictures: &mut [EditedPicture],
    start: &Splats,
    kind: Disagreement,
) -> Result<(), Box<dyn Error>> {
    let mut rng = Pcg64::seed_from_u64(1);
    for picture in pictures {
        let original = render(&picture.camera, start)?;
        let (width, height) = (original.width, original.height);
        let mask =
            dilated(&difference_mask(&original, &picture.image, 8.0 / 255.0), width, width / 100);
        let clean = picture.image.clone();
        let at = |x: f32, y: f32, c: usize| {
            let (x, y) = (x.clamp(0.0, (width - 1) as f32), y.clamp(0.0, (height - 1) as f32));
            let (x0, y0) = (x as usize, y as usize);
            let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
            let (fx, fy) = (x - x0 as f32, y - y0 as f32);
            let p = |x, y| clean.pixel(x, y)[c];
            (1.0 - fy) * ((1.0 - fx) * p(x0, y0) + fx * p(x1, y0))
                + fy * ((1.0 - fx) * p(x0, y1) + fx * p(x1, y1))
        };
        let gain: [f32; 3] = std::array::from_fn(|_| 1.0 + 0.15 * normal(&mut rng));
        let offset: [f32; 3] = std::array::from_fn(|_| 0.04 * normal(&mut rng));
        let shift: [f32; 2] = std::array::from_fn(|_| (2.0 * normal(&mut rng)).round());
        let warp = [waves(&mut rng, 80.0), waves(&mut rng, 80.0)];
        let texture: [_; 3] = std::array::from_fn(|_| waves(&mut rng, 8.0));
        for y in 0..height {
            for x in 0..width {
                if !mask[y * width + x] {
                    continue;
                }
                let (fx, fy) = (x as f32, y as f32);
                for c in 0..3 {
                    let value = match kind {
                        Disagreement::None => continue,
                        Disagreement::Jitter => {
                            gain[c] * at(fx + shift[0], fy + shift[1], c) + offset[c]
                        }
                        Disagreement::Detail => {
                            at(fx + 2.0 * warp[0](fx, fy), fy + 2.0 * warp[1](fx, fy), c)
                                + 0.05 * texture[c](fx, fy)
                        }
                    };
                    picture.image.pixel_mut(x, y)[c] =
                        (value.clamp(0.0, 1.0) * 255.0).round() / 255.0;
                }
            }
        }
    }
    Ok(())
}

/// PSNR against the ground truth: everywhere, inside the edit, and outside (against the start).
fn judge(
    cameras: &[Camera],
    splats: &Splats,
    truth: &Splats,
    start: &Splats,
) -> Result<[f64; 3], Box<dyn Error>> {
    let mut sums = [[0.0_f64; 2]; 3];
    for camera in cameras {
        let (now, truth, before) =
            (render(camera, splats)?, render(camera, truth)?, render(camera, start)?);
        let mask =
            dilated(&difference_mask(&before, &truth, 8.0 / 255.0), now.width, now.width / 100);
        for p in 0..mask.len() {
            for k in 3 * p..3 * p + 3 {
                let error =
                    f64::from(now.data[k].clamp(0.0, 1.0) - truth.data[k].clamp(0.0, 1.0)).powi(2);
                let kept =
                    f64::from(now.data[k].clamp(0.0, 1.0) - before.data[k].clamp(0.0, 1.0)).powi(2);
                for (sum, (on, value)) in
                    sums.iter_mut().zip([(true, error), (mask[p], error), (!mask[p], kept)])
                {
                    if on {
                        sum[0] += value;
                        sum[1] += 1.0;
                    }
                }
            }
        }
    }
    Ok(sums.map(|[sum, count]| -10.0 * (sum / f64::max(count, 1.0)).log10()))
}

/// Remaining coverage at the position of the removed ball, as a share of the ball's own.
fn ball(
    scene: &gs_synth::SynthScene,
    cameras: &[Camera],
    fitted: &Fitted,
    start: &Splats,
) -> Result<f64, Box<dyn Error>> {
    let kept = apply_edits(
        scene,
        &[Edit::Remove { region: Region::parts(&[Part::Ball]).within([0.80, 0.15, 0.50], 0.3) }],
        7,
    )?;
    let mut is_ball = vec![true; start.len()];
    for row in kept.truth.source_rows.iter().flatten() {
        is_ball[*row as usize] = false;
    }
    let rows: Vec<usize> = (0..start.len()).filter(|&i| is_ball[i]).collect();
    let means = start.select(&rows).means;
    let centre = [0, 1, 2].map(|k| means.iter().map(|m| m[k]).sum::<f32>() / means.len() as f32);
    let distance = |m: &[f32; 3]| (0..3).map(|k| (m[k] - centre[k]).powi(2)).sum::<f32>().sqrt();
    let radius = means.iter().map(distance).fold(0.0, f32::max);
    // its remaining splats, and new ones well inside it
    let left: Vec<f32> = (0..fitted.splats.len())
        .map(|i| {
            let is_left = match fitted.source_rows[i] {
                Some(row) => is_ball[row as usize],
                None => distance(&fitted.splats.means[i]) < 0.9 * radius,
            };
            f32::from(u8::from(is_left))
        })
        .collect();
    let before: Vec<f32> = is_ball.iter().map(|&on| f32::from(u8::from(on))).collect();
    let raster = CpuRasterizer::default();
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    let (mut now, mut then) = (0.0_f64, 0.0_f64);
    for camera in cameras {
        for (splats, features, sum) in
            [(&fitted.splats, &left, &mut now), (start, &before, &mut then)]
        {
            let mut prepared = raster.prepare(splats, camera)?;
            let shown = raster.forward(&mut prepared, splats, features, &params)?.features;
            *sum += shown.iter().map(|&x| f64::from(x)).sum::<f64>();
        }
    }
    Ok(now / then)
}
