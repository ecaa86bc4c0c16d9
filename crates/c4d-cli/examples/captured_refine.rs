//! Refinement of a captured scene with known ground truth: colours in a box of the scene are
//! corrupted where its first frame does not constrain them; the original scene is the ground truth.
//!
//! The SH of every splat in the box are corrupted by a component that no training view observes in
//! frame 1, and so are the base colours of splats that no training view shows in frame 1.
//!
//! ```text
//! cargo run --release -p c4d-cli --example captured_refine -- MODEL --region=-2,1,12,2,6,16 -o pictures
//! ```
#![expect(clippy::print_stdout, reason = "prints its results")]
#![allow(dead_code, reason = "the rig is the command's")]

#[path = "../src/camera_rig.rs"]
mod camera_rig;

use camera_rig::{CameraRig, Layout};
use clap::Parser;
use cuar::{NoRefineObserver, RefineOptions, Rejection, Views, WarpForm, WarpParams, refine};
use gs_core::{
    Camera, DynamicScene, Image, Rasterizer, RenderParams, SceneError, Splats, TimeRange,
    UpstreamGrads, sh,
};
use gs_io::checkpoint4dgs;
use gs_io::model_folder::Overrides;
use gs_io::repair::Damage;
use gs_io::{splatv, swift4d};
use gs_raster_cpu::CpuRasterizer;
use std::error::Error;
use std::path::{Path, PathBuf};

type Outcome<T> = Result<T, Box<dyn Error>>;

#[derive(Debug, Parser)]
struct Args {
    /// Model folder of 4DGaussians or Swift4D, or a .splatv
    scene: PathBuf,
    /// Box whose splats are treated as edited: x0,y0,z0,x1,y1,z1 in world units
    #[arg(long, value_delimiter = ',', required = true)]
    region: Vec<f32>,
    /// Size of the SH component that frame 1 does not show
    #[arg(long, default_value_t = 1.5)]
    unseen_sh: f32,
    /// Folder for pictures: before, after, truth
    #[arg(short)]
    output: Option<PathBuf>,
    /// Number of views of the edited frame, which also supervise; two more are held out
    #[arg(long, default_value_t = 3)]
    views: usize,
    /// [`WarpParams::min_known_color`]
    #[arg(long, default_value_t = WarpParams::default().min_known_color)]
    min_known_color: f32,
    /// [`WarpParams::min_visible_share`]
    #[arg(long, default_value_t = WarpParams::default().min_visible_share)]
    min_visible_share: f32,
    /// Number of supervising images
    #[arg(long, default_value_t = 80)]
    samples: usize,
    /// Number of times
    #[arg(long, default_value_t = 31)]
    frames: usize,
    /// Width and height of the images
    #[arg(long, value_delimiter = ',', default_values_t = [480, 360])]
    size: Vec<u32>,
}

/// A scene with other colours.
#[derive(Debug)]
struct Painted<'a> {
    scene: &'a dyn DynamicScene,
    sh: Vec<[f32; 3]>,
    sh_degree: usize,
}

impl DynamicScene for Painted<'_> {
    fn num_splats(&self) -> usize {
        self.scene.num_splats()
    }
    fn sh_degree(&self) -> usize {
        self.sh_degree
    }
    fn time_range(&self) -> TimeRange {
        self.scene.time_range()
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.scene.at_into(t, out)?;
        out.sh.clone_from(&self.sh);
        out.sh_degree = self.sh_degree;
        Ok(())
    }
}

fn main() -> Outcome<()> {
    let args = Args::parse();
    let scene = open(&args.scene)?;
    let (range, times) = (scene.time_range(), scene.time_range().frames(args.frames));
    let first = scene.at(range.start)?;
    let inside =
        |mean: &[f32; 3]| (0..3).all(|k| (args.region[k]..=args.region[k + 3]).contains(&mean[k]));
    let edited: Vec<bool> = first.means.iter().map(inside).collect();
    let rig = CameraRig::of_scene(scene.as_ref(), [0.0, -1.0, 0.0])?;
    let size = (args.size[0], args.size[1]);
    let count = args.views + 2;
    let cameras = match rig.layout {
        Layout::Object => rig.orbit(count, size),
        Layout::Forward => rig.spiral(count, size),
    };
    let held_out = [1, count - 1];
    let training: Vec<Camera> = (0..count)
        .filter(|view| !held_out.contains(view))
        .map(|view| cameras[view].clone())
        .collect();

    let degree = 3;
    let coeffs = sh::num_coeffs(degree);
    let own = sh::num_coeffs(first.sh_degree);
    let mut colors = vec![[0.0; 3]; first.len() * coeffs];
    for (to, from) in colors.chunks_mut(coeffs).zip(first.sh.chunks(own)) {
        to[..own.min(coeffs)].copy_from_slice(&from[..own.min(coeffs)]);
    }
    let truth = Painted { scene: scene.as_ref(), sh: colors.clone(), sh_degree: degree };
    let hidden = hidden(&truth, &training, &times)?;
    let mut random = 7_u64;
    let mut spoiled = 0;
    for i in (0..first.len()).filter(|&i| edited[i]) {
        let own = &mut colors[i * coeffs..(i + 1) * coeffs];
        if hidden[i] {
            spoiled += 1;
            own[0] = sh::dc_from_rgb([(); 3].map(|()| 0.5 + 0.5 * uniform(&mut random)));
        }
        spoil(own, first.means[i], &training, args.unseen_sh, &mut random);
    }
    let before = Painted { scene: scene.as_ref(), sh: colors, sh_degree: degree };
    println!(
        "{} splats, {} in the box, {spoiled} of them hidden in frame 1 and shown later",
        first.len(),
        edited.iter().filter(|edited| **edited).count()
    );
    let eval: Vec<f32> =
        [0.13, 0.37, 0.61, 0.83, 1.0].map(|s| range.start + s * (range.end - range.start)).into();
    let exam = Exam::new(&before, &truth, &cameras, &held_out, &eval)?;
    let base = exam.psnr(&before)?;
    println!(
        "mask {:.2} % of the pixels; before: inside {:.2} dB, outside {:.2} dB",
        100.0 * exam.share(),
        base[0],
        base[1]
    );

    let views = Views { cameras: &cameras, times: &times, held_out: &held_out };
    let usual = WarpParams {
        min_known_color: args.min_known_color,
        min_visible_share: args.min_visible_share,
        ..WarpParams::default()
    };
    let never = WarpParams { min_known_color: 2.0, ..usual };
    for (name, warp, warp_params) in [
        ("default", WarpForm::Backward, usual),
        ("surfaces only", WarpForm::Backward, never),
        ("--warp paper", WarpForm::Paper, WarpParams::default()),
    ] {
        let options =
            RefineOptions { samples: args.samples, warp, warp_params, ..RefineOptions::default() };
        let refined = refine(
            &CpuRasterizer::default(),
            &before,
            &edited,
            &views,
            &options,
            None,
            &mut NoRefineObserver,
        )?;
        let (report, stats) = (&refined.report, &refined.report.supervision);
        let after = refined.scene(&before);
        let [inner, outer] = exam.psnr(&after)?;
        let share = |part: u64, whole: u64| 100.0 * part as f64 / whole.max(1) as f64;
        println!(
            "{name}: inside {:+.2} dB, outside {:+.3} dB; loss {:.3e} → {:.3e}, held-out {:.3e} → {:.3e}",
            inner - base[0],
            outer - base[1],
            report.loss_before,
            report.loss_after,
            report.held_out_before,
            report.held_out_after
        );
        println!(
            "  masked {:.1} % of the edited pixels (threshold is the floor in {} of {} images); surface {:.1} %, splats {:.1} %",
            share(stats.masked, stats.live),
            report.num_floored,
            report.samples.len(),
            share(stats.surface, stats.masked),
            share(stats.splat_colors, stats.masked)
        );
        for (rejection, count) in
            Rejection::ALL.into_iter().zip(stats.rejections).filter(|(_, count)| *count > 0)
        {
            println!("  {}: {:.1} %", rejection.name(), share(count, stats.masked));
        }
        for warning in &report.warnings {
            println!("  {warning}");
        }
        if let (Some(folder), "default") = (&args.output, name) {
            std::fs::create_dir_all(folder)?;
            for &t in &eval {
                let targets = [&before as &dyn DynamicScene, &after, &truth]
                    .map(|scene| render(scene, t, &cameras[1]));
                let [a, b, c] = targets;
                write(&folder.join(format!("t{t:.2}.png")), &[a?, b?, c?])?;
            }
        }
    }
    Ok(())
}

fn open(path: &Path) -> Outcome<Box<dyn DynamicScene>> {
    if path.is_file() {
        return Ok(Box::new(splatv::open(path, Damage::Drop)?.scene));
    }
    let model = match checkpoint4dgs::open(path, &Overrides::default()) {
        Ok(model) => model,
        Err(_) => swift4d::open(path, &Overrides::default())?,
    };
    Ok(match model.scene {
        gs_io::model_folder::ModelScene::Deformed(scene) => scene,
        gs_io::model_folder::ModelScene::HashGrid(scene) => scene,
        gs_io::model_folder::ModelScene::Static(scene) => Box::new(scene),
    })
}

/// Splats whose weight in every view of frame 1 is below a hundredth of their largest weight in any
/// view at later times.
fn hidden(scene: &dyn DynamicScene, cameras: &[Camera], times: &[f32]) -> Outcome<Vec<bool>> {
    let raster = CpuRasterizer::default();
    let mut then = vec![0.0_f32; scene.num_splats()];
    let mut later = then.clone();
    let few = times.iter().step_by(5).enumerate();
    for (k, &t) in few {
        let splats = scene.at(t)?;
        let features = vec![0.0; splats.len()];
        for camera in cameras {
            let mut prepared = raster.prepare(&splats, camera)?;
            let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
            raster.forward(&mut prepared, &splats, &features, &params)?;
            let pixels = camera.width as usize * camera.height as usize;
            let upstream =
                UpstreamGrads { v_features: vec![1.0; pixels], ..UpstreamGrads::default() };
            let grads =
                raster.backward_colors(&mut prepared, &splats, &features, &params, &upstream)?;
            let most = if k == 0 { &mut then } else { &mut later };
            most.iter_mut().zip(&grads.v_features).for_each(|(most, &now)| *most = most.max(now));
        }
    }
    Ok(then.iter().zip(&later).map(|(then, later)| *later > 2.0 && *then < 0.01 * later).collect())
}

/// Adds a random component orthogonal to the colours that `cameras` observe of a splat at `mean`.
fn spoil(sh: &mut [[f32; 3]], mean: [f32; 3], cameras: &[Camera], size: f32, random: &mut u64) {
    let remove = |v: &mut [f32], other: &[f32]| {
        let along: f32 = v.iter().zip(other).map(|(a, b)| a * b).sum();
        v.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
    };
    let mut seen: Vec<Vec<f32>> = Vec::new();
    for camera in cameras {
        #[expect(clippy::cast_possible_truncation, reason = "directions are single precision")]
        let eye = camera.position().map(|x| x as f32);
        let d = [0, 1, 2].map(|k| mean[k] - eye[k]);
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let mut v = sh::basis(3, d.map(|x| x / length))[..sh.len()].to_vec();
        for _ in 0..2 {
            for other in &seen {
                remove(&mut v, other);
            }
        }
        let norm = v.iter().map(|a| a * a).sum::<f32>().sqrt();
        if norm > 1e-3 {
            for a in &mut v {
                *a /= norm;
            }
            seen.push(v);
        }
    }
    for channel in 0..3 {
        let mut extra: Vec<f32> = (0..sh.len()).map(|_| uniform(random)).collect();
        for _ in 0..2 {
            for other in &seen {
                remove(&mut extra, other);
            }
        }
        for (rgb, value) in sh.iter_mut().zip(&extra) {
            rgb[channel] += size * value;
        }
    }
}

fn uniform(state: &mut u64) -> f32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f32 / (1_u64 << 24) as f32 * 2.0 - 1.0
}

fn render(scene: &dyn DynamicScene, t: f32, camera: &Camera) -> Outcome<Image> {
    let splats = scene.at(t)?;
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&splats, camera)?;
    Ok(raster.forward(&mut prepared, &splats, &[], &RenderParams::default())?.rgb_image())
}

/// True images of held-out views, and masks where the unrefined scene is uncertain.
struct Exam<'a> {
    cameras: &'a [Camera],
    /// View, time, truth, mask.
    targets: Vec<(usize, f32, Image, Image)>,
}

impl<'a> Exam<'a> {
    fn new(
        before: &Painted<'_>,
        truth: &Painted<'_>,
        cameras: &'a [Camera],
        views: &[usize],
        times: &[f32],
    ) -> Outcome<Self> {
        let raster = CpuRasterizer::default();
        let usual = RefineOptions::default();
        let then = before.at(before.time_range().start)?;
        let mut targets = Vec::new();
        for &t in times {
            let now = before.at(t)?;
            for &view in views {
                let map = cuar::render_uncertainty(&raster, &now, &then, &cameras[view])?;
                let mask = cuar::artifact_mask(&map, usual.epsilon, usual.min_uncertainty);
                targets.push((view, t, render(truth, t, &cameras[view])?, mask));
            }
        }
        Ok(Self { cameras, targets })
    }

    fn share(&self) -> f32 {
        let each = self
            .targets
            .iter()
            .map(|target| target.3.data.iter().sum::<f32>() / target.3.data.len() as f32);
        each.sum::<f32>() / self.targets.len() as f32
    }

    /// PSNR inside and outside the mask, over all values of all images.
    fn psnr(&self, scene: &dyn DynamicScene) -> Outcome<[f64; 2]> {
        let mut sums = [[0.0_f64; 2]; 2];
        for (view, t, truth, mask) in &self.targets {
            let ours = render(scene, *t, &self.cameras[*view])?;
            for (p, &m) in mask.data.iter().enumerate() {
                let sum = &mut sums[usize::from(m <= 0.0)];
                for k in p * 3..p * 3 + 3 {
                    sum[0] +=
                        f64::from(ours.data[k].clamp(0.0, 1.0) - truth.data[k].clamp(0.0, 1.0))
                            .powi(2);
                    sum[1] += 1.0;
                }
            }
        }
        Ok(sums.map(|[error, count]| -10.0 * (error / count.max(1.0)).max(1e-12).log10()))
    }
}

fn write(path: &Path, images: &[Image]) -> Outcome<()> {
    let (w, h) = (images[0].width, images[0].height);
    let mut out = image::RgbImage::new(u32::try_from(w * images.len())?, u32::try_from(h)?);
    for (k, picture) in images.iter().enumerate() {
        for y in 0..h {
            for x in 0..w {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "0 to 255"
                )]
                let rgb =
                    [0, 1, 2].map(|c| (255.0 * picture.pixel(x, y)[c].clamp(0.0, 1.0) + 0.5) as u8);
                out.put_pixel(u32::try_from(k * w + x)?, u32::try_from(y)?, image::Rgb(rgb));
            }
        }
    }
    out.save(path)?;
    Ok(())
}
