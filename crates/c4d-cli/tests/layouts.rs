//! A scene of short-lived splats renders identically in the layouts of several methods.
//!
//! `C4D_CAPTURED=FILE.splatv cargo test --release --workspace --test layouts -- --ignored
//! --nocapture` does the same with a captured scene and prints the values.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "converters of tests store single precision and bytes"
)]

#[path = "../../gs-io/tests/suite/common/layouts.rs"]
mod layouts;
#[path = "../../gs-io/tests/suite/common/tsog.rs"]
mod tsog;

use gs_core::{Camera, DynamicScene, Rasterizer, RenderOutput, RenderParams, Splats};
use gs_deform::{Polynomial, PolynomialScene};
use gs_io::repair::Damage;
use gs_io::{Clip, Existing, OpenOptions, SceneKind, fourdgs_file, open_scene, splatv};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{ShortLivedParams, ShortLivedScene};
use std::fs;
use std::path::Path;

const SIZE: u32 = 240;
const TIMES: [f32; 4] = [0.0, 0.31, 0.77, 1.0];

/// A figure of splats that are visible for 0.1 to 0.3 of the clip, base colours only. (Checkpoints
/// of FreeTimeGS have no lifetimes below 0.098.)
fn figure() -> PolynomialScene {
    let lifetimes = [0.1, 0.3];
    let params = ShortLivedParams {
        num_splats: 3_000,
        share: 1.0,
        lifetimes,
        ..ShortLivedParams::default()
    };
    let scene = ShortLivedScene::figure(&params).unwrap().lines().unwrap();
    let rest = scene.rest();
    let base = rest.sh.iter().step_by(rest.sh_coeffs()).copied().collect();
    let rest = Splats { sh: base, sh_degree: 0, ..rest.clone() };
    PolynomialScene::new(rest, scene.motions().to_vec()).unwrap()
}

/// The scene with curved motions and rotations.
fn bent(scene: &PolynomialScene) -> PolynomialScene {
    let bend = |(row, motion): (usize, &Polynomial)| {
        let x = (row as f32).sin();
        Polynomial {
            velocity: [motion.velocity[0], [0.5 * x, -0.5, 0.3], [-0.4, 0.6 * x, 0.0]],
            omega: [0.0, 0.4 * x, -0.2, 0.0],
            ..*motion
        }
    };
    let motions = scene.motions().iter().enumerate().map(bend).collect();
    PolynomialScene::new(scene.rest().clone(), motions).unwrap()
}

/// Longest lifetime, clips, because some methods cannot store an infinite one. Such a splat fades
/// by 0.1 % over the clip.
const LONGEST: f32 = 30.0;

/// The scene without the kinds of motion and lifetime that some methods do not support.
fn straight(scene: &PolynomialScene) -> PolynomialScene {
    let line = |motion: &Polynomial| Polynomial {
        width: motion.width.min(LONGEST),
        velocity: [motion.velocity[0], [0.0; 3], [0.0; 3]],
        omega: [0.0; 4],
        ..*motion
    };
    let motions = scene.motions().iter().map(line).collect();
    PolynomialScene::new(scene.rest().clone(), motions).unwrap()
}

/// The scene moved by a twentieth of a unit.
fn displaced(scene: &PolynomialScene) -> PolynomialScene {
    let mut rest = scene.rest().clone();
    for mean in &mut rest.means {
        mean[0] += 0.05;
    }
    PolynomialScene::new(rest, scene.motions().to_vec()).unwrap()
}

/// A camera with the splats in view at half time.
fn camera(scene: &dyn DynamicScene) -> Camera {
    let splats = scene.at(0.5).unwrap();
    let middle = |axis: usize, share: f64| {
        let mut values: Vec<f32> = splats.means.iter().map(|mean| mean[axis]).collect();
        values.sort_by(f32::total_cmp);
        f64::from(values[((values.len() - 1) as f64 * share) as usize])
    };
    let centre = [0, 1, 2].map(|axis| middle(axis, 0.5));
    let extent = (0..3).map(|axis| middle(axis, 0.95) - middle(axis, 0.05)).fold(0.0, f64::max);
    let eye = [centre[0], centre[1], centre[2] + 1.6 * extent];
    Camera::look_at(eye, centre, [0.0, 1.0, 0.0], 0.8, SIZE, SIZE)
}

fn render(scene: &dyn DynamicScene, camera: &Camera, t: f32) -> Vec<f32> {
    let (raster, splats) = (CpuRasterizer::default(), scene.at(t).unwrap());
    let mut prepared = raster.prepare(&splats, camera).unwrap();
    let mut output = RenderOutput::default();
    let params = RenderParams::default();
    raster.forward_into(&mut prepared, &splats, &[], &params, &mut output).unwrap();
    output.rgb
}

/// Smallest PSNR between frames of two scenes, dB, at most 120.
fn likeness(a: &dyn DynamicScene, b: &dyn DynamicScene) -> f64 {
    let camera = camera(a);
    let psnr = |&t: &f32| {
        let (a, b) = (render(a, &camera, t), render(b, &camera, t));
        assert!(a.iter().any(|value| *value > 0.2), "something is seen at {t}");
        let squares = a.iter().zip(&b).map(|(a, b)| f64::from(a - b).powi(2));
        -10.0 * (squares.sum::<f64>() / a.len() as f64).max(1e-12).log10()
    };
    TIMES.iter().map(psnr).fold(f64::INFINITY, f64::min)
}

/// The file read as a scene of this kind.
fn read(path: &Path, kind: &SceneKind) -> std::sync::Arc<dyn DynamicScene> {
    let options = OpenOptions::default().with_time_duration(0.0, 1.0);
    let opened = open_scene(path, &options).unwrap();
    assert_eq!(opened.kind, *kind, "{}", path.display());
    opened.scene
}

/// Frames of the written clips; the shortest lifetimes are twelve frames long.
const FRAMES: usize = 121;

fn as_splatv(scene: &dyn DynamicScene, path: &Path) -> PolynomialScene {
    let times = scene.time_range().frames(FRAMES);
    let options = splatv::WriteOptions {
        tolerance: splatv::DEFAULT_TOLERANCE,
        force: true,
        camera: camera(scene),
        up: [0.0, 1.0, 0.0],
    };
    let clip = Clip { scene, times: &times, fps: 60.0 };
    splatv::write(path, &clip, &options, Existing::Replace, &mut |_| ()).unwrap();
    splatv::open(path, Damage::Fail).unwrap().scene
}

fn as_4dgs(scene: &dyn DynamicScene, frames: usize, path: &Path) -> fourdgs_file::WriteReport {
    let times = scene.time_range().frames(frames);
    let clip = Clip { scene, times: &times, fps: 60.0 };
    let options = fourdgs_file::WriteOptions::default();
    fourdgs_file::write(path, &clip, &options, Existing::Replace, &mut |_| ()).unwrap()
}

#[test]
fn short_lived_splats_render_the_same_in_all_layouts() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let lines = figure();
    let curves = as_splatv(&bent(&lines), &at("curves.splatv"));
    let exact: [(&PolynomialScene, Vec<u8>, SceneKind, f64); 5] = [
        (&curves, layouts::spacetime(&curves), SceneKind::Spacetime, 100.0),
        (&lines, layouts::freetime_ply(&lines), SceneKind::FreeTime, 100.0),
        // Opacities are at least 10⁻⁴, which is never drawn.
        (&lines, layouts::freetime_checkpoint(&lines), SceneKind::FreeTime, 100.0),
        // Splats are not drawn when they have faded to 0.05 of their opacity.
        (&lines, layouts::gaussian4d(&lines), SceneKind::Gaussian4d, 50.0),
        // 8 bits of colour, opacity, size and rotation.
        (&lines, tsog::continuous(&lines), SceneKind::Tsog, 40.0),
    ];
    for (index, (truth, bytes, kind, bar)) in exact.into_iter().enumerate() {
        let path = at(&format!("{index}"));
        fs::write(&path, bytes).unwrap();
        let found = likeness(truth, &*read(&path, &kind));
        eprintln!("{kind}: {found:.1} dB");
        assert!(found > bar, "{kind}: {found} dB");
    }
    // Rows of this format move in straight lines, so curves are split into many (measured: 27.2).
    for (name, scene, rows_per_splat) in [("lines", &lines, 1.3), ("curves", &curves, 30.0)] {
        let path = at(&format!("{name}.4dgs"));
        let report = as_4dgs(scene, FRAMES, &path);
        let found = likeness(scene, &*read(&path, &SceneKind::Fourdgs));
        let rows = report.num_rows as f64 / report.num_splats as f64;
        eprintln!("{name}, .4dgs: {found:.1} dB, {rows:.2} rows a splat");
        assert!(found > 40.0, "{name}: {found} dB");
        assert!(rows < rows_per_splat, "{name}: {rows} rows a splat");
    }
    // Negative control.
    let found = likeness(&curves, &displaced(&curves));
    assert!(found < 30.0, "{found} dB");
}

#[test]
#[ignore = "needs a captured scene: C4D_CAPTURED=FILE.splatv"]
fn a_captured_scene_renders_the_same_in_other_layouts() {
    let path = std::env::var_os("C4D_CAPTURED").expect("C4D_CAPTURED is the path of a .splatv");
    let truth = splatv::open(Path::new(&path), Damage::Drop).unwrap().scene;
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("scene");
    fs::write(&file, layouts::spacetime(&truth)).unwrap();
    let found = likeness(&truth, &*read(&file, &SceneKind::Spacetime));
    eprintln!("Spacetime Gaussians: {found:.1} dB");
    assert!(found > 80.0, "{found} dB");
    let clip = dir.path().join("clip.4dgs");
    let report = as_4dgs(&truth, 61, &clip);
    let found = likeness(&truth, &*read(&clip, &SceneKind::Fourdgs));
    eprintln!(
        ".4dgs: {found:.1} dB, {} splats in {} rows, {:.1} MB",
        report.num_splats,
        report.num_rows,
        fs::metadata(&clip).unwrap().len() as f64 / 1e6
    );
    assert!(found > 40.0, "{found} dB");
    let lines = straight(&truth);
    for (bytes, kind) in [
        (layouts::freetime_ply(&lines), SceneKind::FreeTime),
        (layouts::gaussian4d(&lines), SceneKind::Gaussian4d),
        (tsog::continuous(&lines), SceneKind::Tsog),
    ] {
        fs::write(&file, bytes).unwrap();
        let read = read(&file, &kind);
        let (own, all) = (likeness(&lines, &*read), likeness(&truth, &*read));
        eprintln!(
            "{kind}: {own:.1} dB to the scene with motions along lines, {all:.1} dB to the scene"
        );
    }
}
