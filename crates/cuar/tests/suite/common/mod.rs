//! A case with ground truth: a dancer in a new jacket whose colours are correct in frame 1, and
//! wrong where frame 1 does not show them.
#![allow(dead_code, unreachable_pub, reason = "shared by tests and examples; none uses all of it")]
#![allow(clippy::unwrap_used, reason = "tests may")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "pixels inside the image, single-precision places"
)]

pub mod delivered;
pub mod limits;
pub mod slide;

use cuar::{artifact_mask, render_uncertainty};
use gs_core::{
    Camera, DynamicScene, Image, Rasterizer, RenderParams, SceneError, Splats, TimeRange, sh,
};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{DemoParams, Edit, Kind, Paint, Part, Region, Tag, Truth, apply_edits, demo};

/// The true motion with other colours.
#[derive(Debug, Clone)]
pub struct Painted {
    pub truth: Truth,
    pub sh: Vec<[f32; 3]>,
}

impl DynamicScene for Painted {
    fn num_splats(&self) -> usize {
        self.truth.num_splats()
    }
    fn sh_degree(&self) -> usize {
        self.truth.sh_degree()
    }
    fn time_range(&self) -> TimeRange {
        self.truth.time_range()
    }
    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.truth.at_into(t, out)?;
        out.sh.clone_from(&self.sh);
        Ok(())
    }
}

/// Errors of the colours.
#[derive(Debug, Clone, Copy)]
pub struct Flaws {
    /// Interior splats get a different colour.
    pub interior: bool,
    /// Size of the SH component that no training view observes in frame 1.
    pub unseen_sh: f32,
    /// Noise of every edited splat's base colour, which frame 1 shows, so that refinement must keep
    /// it.
    pub noise: f32,
}

pub struct Case {
    pub scene: Painted,
    pub truth: Truth,
    pub edited: Vec<bool>,
    /// The last two are held out.
    pub cameras: Vec<Camera>,
    pub held_out: Vec<usize>,
}

pub fn uniform(state: &mut u64) -> f32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f32 / (1_u64 << 24) as f32 * 2.0 - 1.0
}

/// `views` training cameras on an arc in front of the dancer, and two more between them.
pub fn cameras(views: usize, width: u32, height: u32) -> (Vec<Camera>, Vec<usize>) {
    let at = |angle: f64, lift: f64| {
        let (sin, cos) = angle.to_radians().sin_cos();
        let eye = [4.4 * sin, 1.2 + lift, 4.4 * cos];
        Camera::look_at(eye, [0.0, 1.2, 0.0], [0.0, 1.0, 0.0], 0.28, width, height)
    };
    let place = |k: f64| at(-40.0 + 80.0 * k, 0.5);
    let mut cameras: Vec<Camera> =
        (0..views).map(|v| place(v as f64 / (views - 1).max(1) as f64)).collect();
    let step = 1.0 / (views - 1).max(1) as f64;
    cameras.extend([place(1.5 * step), place(1.0 - 2.5 * step)]);
    (cameras, vec![views, views + 1])
}

pub fn case(
    num_splats: usize,
    sh_degree: usize,
    views: usize,
    size: (u32, u32),
    flaws: Flaws,
) -> Case {
    let params = DemoParams { num_splats, sh_degree, ..DemoParams::default() };
    let scene = demo(&params).unwrap();
    let jacket = Region::parts(&[
        Part::Chest,
        Part::UpperArmL,
        Part::UpperArmR,
        Part::ForearmL,
        Part::ForearmR,
    ]);
    let edit = Edit::Recolour { region: jacket.clone(), paint: Paint::Jacket };
    let frame = apply_edits(&scene, &[edit], 0).unwrap();
    let truth = frame.truth;
    let edited: Vec<bool> = truth.tags.iter().map(|tag| *tag != Tag::Unchanged).collect();
    let (cameras, held_out) = cameras(views, size.0, size.1);

    let first = &frame.splats;
    let coeffs = first.sh_coeffs();
    let mut colors = first.sh.clone();
    let mut random = 7_u64;
    let rows = truth.scene().rows();
    for i in (0..first.len()).filter(|&i| edited[i]) {
        let own = &mut colors[i * coeffs..(i + 1) * coeffs];
        let interior = rows[i].kind == Kind::Interior;
        if flaws.interior && interior {
            own.fill([0.0; 3]);
            let color = [(); 3].map(|()| 0.5 + 0.5 * uniform(&mut random));
            own[0] = sh::dc_from_rgb(color);
        }
        if flaws.noise > 0.0 {
            for value in &mut own[0] {
                *value += flaws.noise * uniform(&mut random);
            }
        }
        if flaws.unseen_sh > 0.0 {
            let seen = seen_basis(sh_degree, first.means[i], &cameras[..views]);
            for channel in 0..3 {
                let mut extra: Vec<f32> = (0..coeffs).map(|_| uniform(&mut random)).collect();
                for _ in 0..2 {
                    for direction in &seen {
                        let along: f32 = extra.iter().zip(direction).map(|(a, b)| a * b).sum();
                        extra.iter_mut().zip(direction).for_each(|(a, b)| *a -= along * b);
                    }
                }
                for (rgb, value) in own.iter_mut().zip(&extra) {
                    rgb[channel] += flaws.unseen_sh * value;
                }
            }
        }
    }
    let scene = Painted { truth: truth.clone(), sh: colors };
    Case { scene, truth, edited, cameras, held_out }
}

/// Orthonormal basis of the SH vectors in the directions of the cameras.
pub fn seen_basis(degree: usize, mean: [f32; 3], cameras: &[Camera]) -> Vec<Vec<f32>> {
    let coeffs = sh::num_coeffs(degree);
    let mut basis: Vec<Vec<f32>> = Vec::new();
    for camera in cameras {
        let eye = camera.position().map(|x| x as f32);
        let d = [0, 1, 2].map(|k| mean[k] - eye[k]);
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let mut v = sh::basis(degree, d.map(|x| x / length))[..coeffs].to_vec();
        for _ in 0..2 {
            for other in &basis {
                let along: f32 = v.iter().zip(other).map(|(a, b)| a * b).sum();
                v.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
            }
        }
        let norm = v.iter().map(|a| a * a).sum::<f32>().sqrt();
        if norm > 1e-3 {
            for a in &mut v {
                *a /= norm;
            }
            basis.push(v);
        }
    }
    basis
}

pub fn render(scene: &dyn DynamicScene, t: f32, camera: &Camera) -> Image {
    let splats = scene.at(t).unwrap();
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(&splats, camera).unwrap();
    raster.forward(&mut prepared, &splats, &[], &RenderParams::default()).unwrap().rgb_image()
}

/// Artifact mask of the unrefined scene.
pub fn mask(scene: &dyn DynamicScene, t: f32, camera: &Camera, epsilon: f32) -> Image {
    let (at_t, at_1) = (scene.at(t).unwrap(), scene.at(0.0).unwrap());
    let map = render_uncertainty(&CpuRasterizer::default(), &at_t, &at_1, camera).unwrap();
    artifact_mask(&map, epsilon, 0.0)
}

/// Squared error over pixels where `mask` is `inside`, and their number of values.
pub fn squared_error(a: &Image, b: &Image, mask: &Image, inside: bool) -> (f64, f64) {
    let (mut sum, mut count) = (0.0, 0.0);
    for (p, &m) in mask.data.iter().enumerate() {
        if (m > 0.0) == inside {
            for k in p * 3..p * 3 + 3 {
                sum += f64::from(a.data[k].clamp(0.0, 1.0) - b.data[k].clamp(0.0, 1.0)).powi(2);
            }
            count += 3.0;
        }
    }
    (sum, count)
}

/// Means over images of the PSNR inside and outside the mask.
pub fn psnr(scene: &dyn DynamicScene, case: &Case, views: &[usize], times: &[f32]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    let mut count = 0.0;
    for &t in times {
        for &view in views {
            let camera = &case.cameras[view];
            let mask = mask(&case.scene, t, camera, 0.5);
            let [ours, truth] = [scene, &case.truth].map(|scene| render(scene, t, camera));
            for (sum, inside) in sums.iter_mut().zip([true, false]) {
                let (error, values) = squared_error(&ours, &truth, &mask, inside);
                *sum += (-10.0 * (error / values.max(1.0)).log10()).min(100.0);
            }
            count += 1.0;
        }
    }
    sums.map(|sum| sum / count)
}

/// Mean absolute change of colour from one time to the next at the true places of edited surface
/// splats that are in view and inside the mask: flicker of a texture that is static in the object's
/// frame. In view means within 1.5 cm of the rendered depth: limbs are thin. 8-bit levels.
pub fn flicker(scene: &dyn DynamicScene, case: &Case, views: &[usize], times: &[f32]) -> f64 {
    let rows = case.truth.scene().rows();
    let surface: Vec<usize> = (0..case.edited.len())
        .filter(|&i| case.edited[i] && rows[i].kind == Kind::Surface)
        .collect();
    let (mut sum, mut count) = (0.0, 0.0);
    for &view in views {
        let camera = &case.cameras[view];
        let mut before: Option<Vec<Option<[f32; 3]>>> = None;
        for &t in times {
            let splats = case.truth.at(t).unwrap();
            let mask = mask(&case.scene, t, camera, 0.5);
            let image = render(scene, t, camera);
            let depth = depth(&splats, camera);
            let seen = |&i: &usize| {
                let mean = splats.means[i].map(f64::from);
                let [x, y] = camera.project(mean)?;
                let z = camera.to_camera(mean)[2];
                let (px, py) = (x as usize, y as usize);
                let inside = x >= 1.0 && y >= 1.0 && px + 1 < image.width && py + 1 < image.height;
                let shown = inside
                    && mask.pixel(px, py)[0] > 0.0
                    && (f64::from(depth.pixel(px, py)[0]) - z).abs() < 0.003 * z;
                shown.then(|| bilinear(&image, x as f32 - 0.5, y as f32 - 0.5))
            };
            let now: Vec<Option<[f32; 3]>> = surface.iter().map(seen).collect();
            for (a, b) in before.iter().flatten().zip(&now) {
                if let (Some(a), Some(b)) = (a, b) {
                    sum += (0..3).map(|k| f64::from((a[k] - b[k]).abs())).sum::<f64>() / 3.0;
                    count += 1.0;
                }
            }
            before = Some(now);
        }
    }
    255.0 * sum / f64::max(count, 1.0)
}

fn depth(splats: &Splats, camera: &Camera) -> Image {
    let raster = CpuRasterizer::default();
    let mut prepared = raster.prepare(splats, camera).unwrap();
    let out = raster.forward(&mut prepared, splats, &[], &RenderParams::default()).unwrap();
    let mut image = out.depth_image();
    image.data.iter_mut().zip(&out.alpha).for_each(|(z, alpha)| *z /= alpha.max(1e-3));
    image
}

fn bilinear(image: &Image, x: f32, y: f32) -> [f32; 3] {
    let (x0, y0) = (x as usize, y as usize);
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    [0, 1, 2].map(|channel| {
        let at = |dx, dy| image.pixel(x0 + dx, y0 + dy)[channel];
        (1.0 - fy) * ((1.0 - fx) * at(0, 0) + fx * at(1, 0))
            + fy * ((1.0 - fx) * at(0, 1) + fx * at(1, 1))
    })
}
