//! Scenes with known motion as files: for other tools, and to look at.

use anyhow::{Context, Result, bail};
use gs_core::DynamicScene;
use gs_io::ply::WriteOptions;
use gs_io::{Existing, checkpoint4dgs, ply, ply_sequence};
use gs_synth::{FitParams, TruthCase};
use std::path::Path;

/// Frames of the source and of the truth.
const FRAMES: usize = 25;

/// Writes one case into the new folder `out`: the source as a PLY sequence (`source`) and as a deformation network trained on it
/// (`source_4dgs`), the edited first frame (`edited.ply`), its true motion as a PLY sequence (`truth`), and cameras.
pub(crate) fn write(case: &str, seed: u64, size: usize, out: &Path) -> Result<()> {
    if out.exists() {
        bail!("{} exists; give the name of a new folder", out.display());
    }
    let case: TruthCase = case.parse()?;
    let scene = gs_synth::build(case, seed, size)?;
    std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    sequence(&scene.source, &out.join("source"))?;
    sequence(&scene.edited.truth, &out.join("truth"))?;
    let edited = &scene.edited.splats;
    ply::write_file(out.join("edited.ply"), edited, &options(), Existing::Refuse)?;
    gs_io::cameras_json::write_file(out.join("cameras.json"), &scene.cameras, Existing::Refuse)?;
    let params = FitParams { seed, ..FitParams::default() };
    let fitted = gs_synth::fit_hexplane(&scene.source, scene.figure_size, &params)?;
    let steps = params.steps as u64;
    checkpoint4dgs::write(
        out.join("source_4dgs"),
        steps,
        &fitted.canonical,
        &fitted.network,
        Existing::Refuse,
    )?;
    eprintln!("the network misses its own training by {:?} (% of the figure)", fitted.residual);
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
