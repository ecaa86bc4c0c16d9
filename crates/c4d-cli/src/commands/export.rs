//! `c4d export`: writes the scene as files for other tools.

mod clip;
mod flags;
mod html;
mod manifest;
mod messages;
mod snapshot;

pub(crate) use html::failure as page_failure;
pub(crate) use messages::note_losses;

use crate::args::{ExportArgs, ExportFormat, Global, Up};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames::{self, Timing};
use crate::memory;
use crate::output::{check_sh_degree, existing, output_failure, refuse_overlap};
use crate::scene;
use gs_io::ply::WriteOptions;
use gs_io::ply::comments;
use gs_io::{compressed_ply, ply_sequence};
use messages::{note_written, plain_losses};

/// Largest size of a plain zip, bytes; players that stream archives do not support zip64.
const ZIP_LIMIT: u64 = u32::MAX as u64;
/// Largest overhead of an entry besides its data, bytes.
const ZIP_ENTRY: u64 = 256;

pub(crate) fn run(args: &ExportArgs, global: &Global, console: &Console) -> Outcome {
    let to = flags::format_of(args)?;
    let mut opened = scene::open(&args.scene, global, console)?;
    memory::require_frames(opened.scene.as_ref(), memory::FRAMES_PACKED)?;
    opened.up = args.up.map_or(opened.up, Up::vector);
    if to.is_snapshot() {
        return snapshot::write(args, to, &opened, global, console);
    }
    let timing =
        Timing { times: &args.times, frames: args.frames, fps: args.fps, duration: args.duration };
    timing.check()?;
    let times = timing.times(opened.scene.as_ref())?;
    let fps = timing.fps(&opened, &times)?;
    if to.is_clip() {
        return clip::write(args, to, &opened, (&times, fps), global, console);
    }
    if to == ExportFormat::Html {
        return html::write(args, &opened, (&times, fps), global, console);
    }
    if times.len() < 2 {
        return Err(Failure::usage("a sequence needs at least 2 frames")
            .next("For one frame: --to ply (or compressed-ply, spz, splat, glb) with --time T."));
    }
    check_sh_degree(args.sh_degree, opened.scene.sh_degree())?;
    refuse_overlap(&args.output, &opened.roots)?;
    let mut comments = vec![format!("{}{fps}", comments::FPS)];
    comments.extend(comments::up_comments(opened.up));
    let options = WriteOptions { normals: !args.no_normals, comments, sh_degree: args.sh_degree };
    if to == ExportFormat::Zip {
        let splats = opened.scene.at(times[0]).map_err(Failure::input)?;
        let frame = options.file_size(&splats) + ZIP_ENTRY;
        if frame * times.len() as u64 > ZIP_LIMIT {
            return Err(Failure::usage(format!(
                "{} frames of {:.1} MB exceed the 4 GiB of a plain zip",
                times.len(),
                frame as f64 / 1e6
            ))
            .next(format!(
                "At most --frames {}; or --to ply-seq, --sh-degree 0.",
                ZIP_LIMIT / frame
            )));
        }
    }
    // Refuse the output before the work, not after it.
    let manifest = manifest::create(&args.output, existing(global))?;
    let mut progress = console.progress("export", times.len() as u64);
    let mut step = |done: usize| progress.set(done as u64);
    let (scene, output) = (opened.scene.as_ref(), &args.output);
    let written = match to {
        ExportFormat::Zip => {
            ply_sequence::write_zip(output, scene, &times, &options, existing(global), &mut step)
                .map(|()| plain_losses(args, scene.sh_degree()))
        }
        ExportFormat::CompressedSeq => {
            let options = compressed_ply::WriteOptions {
                comments: options.comments,
                sh_degree: args.sh_degree,
                order: None,
            };
            let existing = existing(global);
            ply_sequence::write_compressed_folder(
                output, scene, &times, &options, existing, &mut step,
            )
        }
        _ => {
            ply_sequence::write_folder(output, scene, &times, &options, existing(global), &mut step)
                .map(|()| plain_losses(args, scene.sh_degree()))
        }
    };
    let mut losses = written.map_err(|error| output_failure(&error))?;
    losses.push(
        "the format stores no frame rate (players assume 24 to 30); the manifest next to it does",
    );
    let elapsed = progress.finish();
    manifest.write(&manifest::Content {
        fps,
        times: &times,
        num_splats: scene.num_splats(),
        sh_degree: args.sh_degree.unwrap_or(scene.sh_degree()),
        up: opened.up,
    })?;
    let playing = frames::playing(times.len(), fps);
    let what = format!("{} splats, {playing}", scene.num_splats());
    note_written(output, elapsed, &what, &losses, console);
    Ok(())
}
