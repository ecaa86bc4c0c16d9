//! Rendering does not depend on size and position of a scene: images of scaled and moved copies
//! with rigs, and with correspondingly transformed cameras.

use crate::support::{c4d, failure, fixture, listing, success};
use gs_core::image_formation::NEAR_PLANE;
use gs_core::{Camera, Extent, Rasterizer, RenderParams, Splats};
use gs_io::checkpoint4dgs;
use gs_io::model_folder::{ModelScene, Overrides};
use gs_io::{Existing, cameras_json, ply};
use gs_raster_cpu::CpuRasterizer;
use std::path::{Path, PathBuf};

/// Smallest PSNR of 8-bit images with rigs, which are built from rounded positions, dB.
const RIG_DB: f64 = 45.0;
/// Smallest PSNR with given cameras, dB.
const CAMERA_DB: f64 = 50.0;

/// The fixture's scene, scaled about the origin and moved.
fn placed(root: &Path, scale: f64, shift: [f64; 3]) -> PathBuf {
    let folder = root.join(format!("scene_{scale}_{}", shift[0]));
    std::fs::create_dir(&folder).unwrap();
    for name in listing(&fixture("synth/source")) {
        let read = ply::read_file(&fixture("synth/source").join(&name)).unwrap();
        let options = ply::WriteOptions { comments: read.comments, ..Default::default() };
        let splats = moved(read.splats, scale, shift);
        ply::write_file(&folder.join(name), &splats, &options, Existing::Refuse).unwrap();
    }
    folder
}

#[expect(clippy::cast_possible_truncation, reason = "files hold single precision")]
fn moved(mut splats: Splats, scale: f64, shift: [f64; 3]) -> Splats {
    for mean in &mut splats.means {
        *mean = [0, 1, 2].map(|k| (f64::from(mean[k]) * scale + shift[k]) as f32);
    }
    for log_scale in splats.log_scales.as_flattened_mut() {
        *log_scale += scale.ln() as f32;
    }
    splats
}

/// Renders two times of the scene, with the cameras given by
/// `more`. Returns the image and the messages.
fn picture(scene: &Path, more: &[&str]) -> (Vec<u8>, String) {
    let png = scene.with_extension("png");
    let mut command = c4d(["render", "--size", "160x120", "--times", "0,0.5", "-w", "-g", "cpu"]);
    let (_, stderr) = success(command.args(more).arg(scene).arg("-o").arg(&png));
    (image::open(&png).unwrap().to_rgb8().into_raw(), stderr)
}

fn psnr(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len(), "sizes");
    let square = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
    10.0 * (255.0 * 255.0 * a.len() as f64 / square.max(1e-9)).log10()
}

#[test]
fn rigs_render_the_same_image_for_any_size_and_position() {
    let folder = tempfile::tempdir().unwrap();
    let here = placed(folder.path(), 1.0, [0.0; 3]);
    for cameras in ["front", "orbit"] {
        let (expected, _) = picture(&here, &["--cameras", cameras]);
        assert!(
            expected.iter().filter(|value| **value > 60).count() > 3000,
            "the scene is \
            visible"
        );
        for (scale, shift) in [
            (0.001, [0.0; 3]),
            (0.01, [0.0; 3]),
            (100.0, [0.0; 3]),
            (1000.0, [0.0; 3]),
            (1.0, [2000.0, -500.0, 900.0]),
        ] {
            let scene = folder.path().join(format!("scene_{scale}_{}", shift[0]));
            let scene = if scene.exists() { scene } else { placed(folder.path(), scale, shift) };
            let (found, stderr) = picture(&scene, &["--cameras", cameras]);
            let db = psnr(&found, &expected);
            assert!(db > RIG_DB, "{cameras}, {scale} times, moved by {shift:?}: {db:.1} dB");
            assert!(!stderr.contains("warning"), "{stderr}");
        }
    }
}

#[test]
fn cameras_of_a_file_render_a_small_scene_and_its_run() {
    let folder = tempfile::tempdir().unwrap();
    let camera = |scale: f64| {
        let at = |p: [f64; 3]| p.map(|x| scale * x);
        Camera::look_at(at([0.5, 1.4, 4.5]), at([0.0, 0.9, 0.0]), [0.0, 1.0, 0.0], 0.7, 160, 120)
    };
    let mut pictures = Vec::new();
    for scale in [1.0, 0.01] {
        let scene = placed(folder.path(), scale, [0.0; 3]);
        let cameras = folder.path().join(format!("cameras_{scale}.json"));
        cameras_json::write_file(&cameras, &[camera(scale)], Existing::Refuse).unwrap();
        let cameras = cameras.to_str().unwrap();
        pictures.push(picture(&scene, &["--cameras", cameras]).0);

        // A propagated and refined edit of the scene has the near plane of the source.
        let edit = folder.path().join(format!("edit_{scale}.ply"));
        let splats = ply::read_file(&fixture("synth/edited.ply")).unwrap().splats;
        let options = ply::WriteOptions::default();
        ply::write_file(&edit, &moved(splats, scale, [0.0; 3]), &options, Existing::Refuse)
            .unwrap();
        let run = folder.path().join(format!("run_{scale}"));
        let mut propagate = c4d(["propagate", "--refine-cameras", cameras, "-g", "cpu"]);
        propagate.args(["--refine-frames", "3", "--samples", "4"]);
        success(propagate.arg(&scene).arg("--edited").arg(&edit).arg("-o").arg(&run));
        pictures.push(picture(&run, &["--cameras", cameras]).0);
    }
    let [source, run, small_source, small_run] = &pictures[..] else { panic!("four pictures") };
    let (a, b) = (psnr(source, small_source), psnr(run, small_run));
    assert!(a > CAMERA_DB && b > CAMERA_DB, "source {a:.1} dB, run {b:.1} dB");
    let edit = psnr(source, run);
    assert!(edit < a.min(b) - 10.0, "negative control: the edit is visible: {edit:.1} dB");
}

#[test]
fn positions_too_coarse_in_single_precision_cause_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let scene = placed(folder.path(), 1.0, [1e6, 0.0, 0.0]);
    let (_, stderr) = picture(&scene, &[]);
    assert!(
        stderr.contains("warning") && stderr.contains("1.0e6 units from its origin"),
        "{stderr}"
    );
}

#[test]
fn an_empty_image_causes_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let away = Camera::look_at([0.0, 1.0, 9.0], [0.0, 1.0, 20.0], [0.0, 1.0, 0.0], 0.7, 64, 48);
    let cameras = folder.path().join("cameras.json");
    cameras_json::write_file(&cameras, &[away], Existing::Refuse).unwrap();
    let render = |out: &str, more: &[&str]| {
        let mut command = c4d(["render", "--frames", "2", "-g", "cpu", "--cameras"]);
        command.arg(&cameras).args(more).arg(fixture("synth/source"));
        command.arg("-o").arg(folder.path().join(out));
        command
    };
    let (_, stderr) = success(&mut render("a.png", &[]));
    assert!(stderr.contains("warning: no image shows any of the scene's splats"), "{stderr}");
    let output = render("b.png", &["--strict"]).output().unwrap();
    assert_eq!(output.status.code(), Some(6), "a warning under --strict");
    failure(&mut render("a.png", &[]), 2);
}

#[test]
fn training_cameras_keep_the_reference_near_plane() {
    let folder = tempfile::tempdir().unwrap();
    let model = fixture("deform4dgs/dnerf_like/model");
    let opened = checkpoint4dgs::open(&model, &Overrides::default()).unwrap();
    let ModelScene::Deformed(scene) = opened.scene else { panic!("a deformed model") };
    let splats = gs_core::DynamicScene::at(scene.as_ref(), 0.0).unwrap();
    let extent = Extent::of(&splats);
    // In front of the most opaque splat, nearer than the reference's
    // near plane but farther than the scene's.
    let row = |a: &usize, b: &usize| splats.opacity(*a).total_cmp(&splats.opacity(*b));
    let row = (0..splats.len()).max_by(row).unwrap();
    let [x, y, z] = splats.means[row].map(f64::from);
    let eye = [x, y - f64::midpoint(extent.near_plane(), NEAR_PLANE), z];
    let camera = Camera::look_at(eye, [x, y, z], [0.0, 0.0, 1.0], 1.0, 64, 48);
    let cameras = folder.path().join("cameras.json");
    cameras_json::write_file(&cameras, std::slice::from_ref(&camera), Existing::Refuse).unwrap();

    let rendered = |reading: &[&str], out: &str| -> Vec<f32> {
        let out = folder.path().join(out);
        let mut command = c4d(["render", "--times", "0", "--format", "npy", "-g", "cpu"]);
        command.args(["--background", "black"]).args(reading).arg("--cameras").arg(&cameras);
        success(command.arg(&model).arg("-o").arg(&out));
        let bytes = std::fs::read(out.join("rgb/00000.npy")).unwrap();
        let values = &bytes[bytes.len() - 64 * 48 * 3 * 4..];
        values.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect()
    };
    let expected = |near: f64| {
        let (raster, camera) = (CpuRasterizer::default(), camera.clone().with_near(near));
        let mut prepared = raster.prepare(&splats, &camera).unwrap();
        raster.forward(&mut prepared, &splats, &[], &RenderParams::default()).unwrap().rgb
    };
    let apart =
        |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let trained = expected(NEAR_PLANE);
    assert!(apart(&rendered(&[], "trained"), &trained) < 1e-5, "as the reference");
    let stored = expected(extent.near_plane());
    let found = rendered(&["--cameras-as", "stored"], "stored");
    assert!(apart(&found, &stored) < 1e-5, "near plane {}", extent.near_plane());
    assert!(apart(&stored, &trained) > 0.02, "negative control: the near plane matters here");
}
