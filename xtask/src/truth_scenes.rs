//! Writes scenes with known motion to files, for other tools and for inspection.

use anyhow::{Context, Result};
use gs_core::{Camera, DynamicScene, Image, Rasterizer, RenderOutput, RenderParams};
use gs_io::ply::WriteOptions;
use gs_io::{AtomicDir, Existing, checkpoint4dgs, ply, ply_sequence};
use gs_raster_cpu::CpuRasterizer;
use gs_synth::{FitParams, TruthCase};
use std::path::Path;

/// Frames of the source and of the ground truth.
const FRAMES: usize = 25;

/// Number of cameras with a video, evenly spaced among all.
const VIEWS: usize = 4;
/// Size of the images of a video, pixels.
const IMAGE: (u32, u32) = (400, 300);

/// Writes one case into the new folder `output`: the source as a PLY sequence (`source`) and as a
/// deformation network trained on it (`source_4dgs`), the edited first frame (`edited.ply`), its
/// true motion as a PLY sequence (`truth`) and as PNG frames (`video/<camera>`), and cameras. On
/// failure, the folder is removed.
pub(crate) fn write(case: &str, seed: u64, size: usize, output: &Path) -> Result<()> {
    let case: TruthCase = case.parse().with_context(|| {
        let known: Vec<&str> = TruthCase::ALL.iter().map(|case| case.name()).collect();
        format!("cases are {}", known.join(", "))
    })?;
    // Never replace an existing folder.
    let folder = AtomicDir::create(output, Existing::Refuse)?;
    let out = folder.path();
    let scene = gs_synth::build(case, seed, size)?;
    sequence(&scene.source, &out.join("source"))?;
    sequence(&scene.edited.truth, &out.join("truth"))?;
    let edited = &scene.edited.splats;
    ply::write_file(&out.join("edited.ply"), edited, &options(), Existing::Refuse)?;
    gs_io::cameras_json::write_file(&out.join("cameras.json"), &scene.cameras, Existing::Refuse)?;
    let step = scene.cameras.len().div_ceil(VIEWS).max(1);
    for camera in scene.cameras.iter().step_by(step) {
        video(&scene.edited.truth, camera, &out.join("video").join(&camera.name))?;
    }
    let params = FitParams { seed, ..FitParams::default() };
    let fitted = gs_synth::fit_hexplane(&scene.source, scene.figure_size, &params)?;
    let steps = params.steps as u64;
    checkpoint4dgs::write(
        &out.join("source_4dgs"),
        steps,
        &fitted.canonical,
        &fitted.network,
        Existing::Refuse,
    )?;
    folder.commit()?;
    let residual = fitted.residual;
    eprintln!(
        "training error of the network: {:.2} % of the figure (p95 {:.2} %), {:.1}°",
        residual.mean, residual.p95, residual.rot_deg
    );
    Ok(())
}

fn options() -> WriteOptions {
    WriteOptions { comments: vec!["c4d_up y".to_owned()], ..WriteOptions::default() }
}

fn sequence(scene: &dyn DynamicScene, folder: &Path) -> Result<()> {
    let mut writer = ply_sequence::FolderWriter::create(folder, Existing::Refuse)?;
    for t in scene.time_range().frames(FRAMES) {
        writer.push(&scene.at(t)?, &options())?;
    }
    writer.finish()?;
    Ok(())
}

/// One PNG per frame, over a grey background.
fn video(scene: &dyn DynamicScene, camera: &Camera, folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let camera = camera.resized(IMAGE.0, IMAGE.1);
    let raster = CpuRasterizer::default();
    let params = RenderParams { background: [0.5; 3], ..RenderParams::default() };
    let mut output = RenderOutput::default();
    for (i, t) in scene.time_range().frames(FRAMES).into_iter().enumerate() {
        let splats = scene.at(t)?;
        let mut prepared = raster.prepare(&splats, &camera)?;
        raster.forward_into(&mut prepared, &splats, &[], &params, &mut output)?;
        let path = folder.join(format!("frame_{i:05}.png"));
        save(&output.rgb_image(), &path).with_context(|| path.display().to_string())?;
    }
    Ok(())
}

fn save(image: &Image, path: &Path) -> Result<()> {
    let (width, height) = (u32::try_from(image.width)?, u32::try_from(image.height)?);
    let color = image::ExtendedColorType::Rgb8;
    Ok(image::save_buffer(path, &image.to_bytes(), width, height, color)?)
}
