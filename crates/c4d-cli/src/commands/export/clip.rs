//! `c4d export` of a whole clip into one file: `.splat4d`, `.4dgs`, OpenUSD, `.splatv`.

use super::messages::note_written;
use crate::args::ExportFormat;
use crate::args::{ExportArgs, Global};
use crate::camera_rig::{CameraRig, DEFAULT_SIZE};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::output::{check_sh_degree, existing, output_failure, refuse_overlap};
use crate::scene::LoadedScene;
use gs_io::{Clip, FormatLosses, IoError, fourdgs_file, splat4d, splatv, usda};
use std::time::Instant;

pub(super) fn write(
    args: &ExportArgs,
    to: ExportFormat,
    opened: &LoadedScene,
    (times, fps): (&[f32], f64),
    global: &Global,
    console: &Console,
) -> Outcome {
    check(args, opened)?;
    let clip = Clip { scene: opened.scene.as_ref(), times, fps };
    let start = Instant::now();
    let (written, losses) = match to {
        ExportFormat::Fourdgs => write_4dgs(args, &clip, global, console)?,
        ExportFormat::Usda => write_usda(args, opened, &clip, global, console)?,
        ExportFormat::Splatv => write_splatv(args, opened, &clip, global, console)?,
        _ => write_splat4d(args, opened, &clip, global, console)?,
    };
    let what = format!("{}; {written}", crate::frames::playing(times.len(), fps));
    note_written(&args.output, start.elapsed(), &what, &losses, console);
    Ok(())
}

fn check(args: &ExportArgs, opened: &LoadedScene) -> Outcome {
    check_sh_degree(args.sh_degree, opened.scene.sh_degree())?;
    refuse_overlap(&args.output, &opened.roots)?;
    match args.tolerance {
        Some(share) if !(share > 0.0 && share <= 1.0) => {
            Err(Failure::usage(format!("--tolerance {share}: expected above 0, at most 1")))
        }
        _ => Ok(()),
    }
}

/// Description of the written file, and its losses.
type Written = (String, FormatLosses);

fn write_splat4d(
    args: &ExportArgs,
    opened: &LoadedScene,
    clip: &Clip<'_>,
    global: &Global,
    console: &Console,
) -> Outcome<Written> {
    let mut options =
        splat4d::WriteOptions { up: Some(opened.up), ..splat4d::WriteOptions::default() };
    options.tolerance = args.tolerance.unwrap_or(options.tolerance);
    let mut progress = console.progress("export", (splat4d::PASSES * clip.times.len()) as u64);
    let mut step = |done: usize| progress.set(done as u64);
    let report = splat4d::write(&args.output, clip, &options, existing(global), &mut step)
        .map_err(|error| failure(ExportFormat::Splat4d, &error))?;
    progress.finish();
    let written = format!(
        "{} splats, {} of them moving; coordinates are within {:.2e} scene units at every splat \
        and frame",
        report.num_splats, report.moving, report.position_bound
    );
    Ok((written, report.losses))
}

fn write_4dgs(
    args: &ExportArgs,
    clip: &Clip<'_>,
    global: &Global,
    console: &Console,
) -> Outcome<Written> {
    let mut options = fourdgs_file::WriteOptions::default();
    options.tolerance = args.tolerance.unwrap_or(options.tolerance);
    options.sh_degree = args.sh_degree.unwrap_or(options.sh_degree);
    let mut progress = console.progress("export", fourdgs_file::evaluations(clip) as u64);
    let mut step = |done: usize| progress.set(done as u64);
    let report = fourdgs_file::write(&args.output, clip, &options, existing(global), &mut step)
        .map_err(|error| failure(ExportFormat::Fourdgs, &error))?;
    progress.finish();
    let written = format!("{} splats in {} rows", report.num_splats, report.num_rows);
    Ok((written, report.losses))
}

fn write_usda(
    args: &ExportArgs,
    opened: &LoadedScene,
    clip: &Clip<'_>,
    global: &Global,
    console: &Console,
) -> Outcome<Written> {
    let options = usda::WriteOptions {
        up: opened.up,
        sh_degree: args.sh_degree,
        size_limit: if args.force { u64::MAX } else { usda::SIZE_LIMIT },
    };
    let mut progress = console.percent("export");
    let mut step = |done: usize, of: usize| progress.set((100 * done / of) as u64);
    let report = usda::write(&args.output, clip, &options, existing(global), &mut step)
        .map_err(|error| failure(ExportFormat::Usda, &error))?;
    progress.finish();
    let sampled = if report.sampled.is_empty() {
        "nothing changes".to_owned()
    } else {
        format!("samples of {}", report.sampled.join(", "))
    };
    Ok((format!("{} splats, {sampled}", report.num_splats), report.losses))
}

fn write_splatv(
    args: &ExportArgs,
    opened: &LoadedScene,
    clip: &Clip<'_>,
    global: &Global,
    console: &Console,
) -> Outcome<Written> {
    let scene = opened.original.as_ref().unwrap_or(&opened.scene);
    let rig = CameraRig::of_scene(scene.as_ref(), opened.up).map_err(Failure::input)?;
    let options = splatv::WriteOptions {
        tolerance: args.tolerance.unwrap_or(splatv::DEFAULT_TOLERANCE),
        force: args.force,
        camera: rig.front(DEFAULT_SIZE),
        up: opened.up,
    };
    let mut progress = console.progress("export", (splatv::PASSES * clip.times.len()) as u64);
    let mut step = |done: usize| progress.set(done as u64);
    let report = splatv::write(&args.output, clip, &options, existing(global), &mut step)
        .map_err(|error| failure(ExportFormat::Splatv, &error))?;
    progress.finish();
    let (width, height) = DEFAULT_SIZE;
    let written = format!(
        "{} splats; pixels below are those of the front view at {width}×{height}",
        report.num_splats
    );
    Ok((written, report.losses))
}

/// Adds the next step to an error about a format that does not suit the clip.
fn failure(to: ExportFormat, error: &IoError) -> Failure {
    match error {
        IoError::Unfit { .. } if to == ExportFormat::Splatv => Failure::usage(error).next(
            "Choose times close together, for example --times 0,0.01,0.02. --tolerance SHARE allows larger errors, --force any error; --to splat4d keeps any motion.",
        ),
        IoError::Unfit { .. } => {
            Failure::usage(error).next("Use --frames N with a smaller N, --sh-degree 0, or --force.")
        }
        _ => output_failure(error),
    }
}
