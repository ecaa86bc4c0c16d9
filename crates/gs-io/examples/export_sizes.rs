//! Prints a table of write times and sizes of a clip in every format.
//!
//! `cargo run --release --example export_sizes -- SPLATS FRAMES`

use gs_core::{Camera, DynamicScene, TimeRange};
use gs_io::ply::WriteOptions;
use gs_io::{Clip, Existing, compressed_ply, ply_sequence, splat4d, splatv, usda};
use gs_synth::{DemoParams, demo};
use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

type Done = Result<(), Box<dyn Error>>;

fn main() -> Done {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let (num_splats, num_frames) = (number(100_000)?, number(60)?);
    let scene = demo(&DemoParams { num_splats, sh_degree: 3, ..DemoParams::default() })?;
    let times = TimeRange::UNIT.frames(num_frames);
    let clip = Clip { scene: &scene, times: &times, fps: 30.0 };
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);

    let mut out = std::io::stdout().lock();
    writeln!(out, "{num_splats} splats of SH degree 3, {num_frames} frames\n")?;
    writeln!(out, "| format | seconds | MB | bytes per splat and frame |\n|---|---|---|---|")?;
    let mut row = |name: &str, write: &mut dyn FnMut(&Path) -> Done| {
        let (path, start) = (at("out"), Instant::now());
        write(&path)?;
        let seconds = start.elapsed().as_secs_f64();
        let bytes = size(&path)?;
        let each = bytes as f64 / (num_splats * num_frames) as f64;
        writeln!(out, "| {name} | {seconds:.1} | {:.1} | {each:.2} |", bytes as f64 / 1e6)?;
        if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) }?;
        Ok::<(), Box<dyn Error>>(())
    };

    let mut splats = scene.at(0.0)?;
    row("evaluating the scene", &mut |path| {
        times.iter().try_for_each(|&t| scene.at_into(t, &mut splats))?;
        Ok(std::fs::write(path, [])?)
    })?;
    let plain = WriteOptions::default();
    row("PLY sequence", &mut |path| {
        Ok(ply_sequence::write_folder(path, &scene, &times, &plain, Existing::Refuse, &mut |_| ())?)
    })?;
    row("PLY zip", &mut |path| {
        Ok(ply_sequence::write_zip(path, &scene, &times, &plain, Existing::Refuse, &mut |_| ())?)
    })?;
    row("compressed PLY sequence", &mut |path| {
        let options = compressed_ply::WriteOptions::default();
        let existing = Existing::Refuse;
        ply_sequence::write_compressed_folder(
            path,
            &scene,
            &times,
            &options,
            existing,
            &mut |_| (),
        )?;
        Ok(())
    })?;
    row("`.splat4d`", &mut |path| {
        let options = splat4d::WriteOptions::default();
        splat4d::write(path, &clip, &options, Existing::Refuse, &mut |_| ())?;
        Ok(())
    })?;
    row("`.usda`, SH degree 0", &mut |path| {
        let options = usda::WriteOptions {
            sh_degree: Some(0),
            size_limit: u64::MAX,
            ..usda::WriteOptions::default()
        };
        usda::write(path, &clip, &options, Existing::Refuse, &mut |_, _| ())?;
        Ok(())
    })?;
    row("`.usda`, SH degree 3", &mut |path| {
        let options = usda::WriteOptions { size_limit: u64::MAX, ..usda::WriteOptions::default() };
        usda::write(path, &clip, &options, Existing::Refuse, &mut |_, _| ())?;
        Ok(())
    })?;
    row("`.splatv` (forced: cubics do not fit a clip of this length)", &mut |path| {
        let camera =
            Camera::look_at([0.0, 1.0, 4.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], 0.7, 960, 720);
        let options = splatv::WriteOptions {
            tolerance: splatv::DEFAULT_TOLERANCE,
            force: true,
            camera,
            up: [0.0, 1.0, 0.0],
        };
        splatv::write(path, &clip, &options, Existing::Refuse, &mut |_| ())?;
        Ok(())
    })
}

/// Bytes of a file, or of all files of a folder.
fn size(path: &Path) -> std::io::Result<u64> {
    if path.is_file() {
        return Ok(path.metadata()?.len());
    }
    std::fs::read_dir(path)?.map(|entry| Ok(entry?.metadata()?.len())).sum()
}
