//! `c4d export`: the scene as files that other tools open.

mod html;
mod snapshot;

use super::freeze::{check_sh_degree, existing, output_failure};
use crate::args::{ExportArgs, ExportFormat, Global};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::{frames, scene};
use gs_io::ply::WriteOptions;
use gs_io::{Losses, compressed_ply, ply_sequence};

/// Bytes of a plain zip: players that stream archives know no zip64.
const ZIP_LIMIT: u64 = u32::MAX as u64;
/// Bytes of an entry besides its data, at most.
const ZIP_ENTRY: u64 = 256;

pub(crate) fn run(args: &ExportArgs, global: &Global, console: &Console) -> Outcome {
    let opened = scene::open(&args.scene, global, console)?;
    if args.to.is_snapshot() {
        return snapshot::write(args, &opened, global, console);
    }
    let times = frames::times(opened.scene.as_ref(), &args.times, args.frames)?;
    if args.to.is_clip() {
        return super::export_clip::run(args, &opened, &times, global, console);
    }
    if args.to == ExportFormat::Html {
        return html::write(args, &opened, &times, global, console);
    }
    if times.len() < 2 {
        return Err(Failure::usage("a sequence needs at least 2 frames")
            .next("For one frame: --to compressed-ply, spz or splat with --time T, or c4d freeze --time T."));
    }
    check_sh_degree(args.sh_degree, opened.scene.sh_degree())?;
    crate::frames::check_fps(args.fps)?;
    scene::refuse_overlap(&args.output, &opened.roots)?;
    let mut comments = vec![format!("c4d_fps {}", args.fps)];
    comments.extend(scene::up_comments(opened.up));
    let options = WriteOptions { normals: !args.no_normals, comments, sh_degree: args.sh_degree };
    if args.to == ExportFormat::Zip {
        let splats = opened.scene.at(times[0]).map_err(Failure::bad_input)?;
        let frame = options.file_size(&splats) + ZIP_ENTRY;
        if frame * times.len() as u64 > ZIP_LIMIT {
            return Err(Failure::usage(format!(
                "{} frames of {:.1} MB are more than the 4 GiB of a plain zip",
                times.len(),
                frame as f64 / 1e6
            ))
            .next(format!(
                "At most --frames {}; or --to ply-seq, --sh-degree 0.",
                ZIP_LIMIT / frame
            )));
        }
    }
    let mut progress = console.progress("export", times.len() as u64);
    let mut step = |done: usize| progress.set(done as u64);
    let (scene, output) = (opened.scene.as_ref(), &args.output);
    let written = match args.to {
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
    losses.push("the format has no frame rate: players assume 24 to 30");
    let elapsed = progress.finish();
    console.note(format!(
        "{} frames of {} splats in {:.1} s",
        times.len(),
        scene.num_splats(),
        elapsed.as_secs_f64(),
    ));
    say(&losses, console);
    console.result(output.display());
    Ok(())
}

/// What a sequence of 32-bit floats loses.
fn plain_losses(args: &ExportArgs, available: usize) -> Losses {
    let mut losses = Losses::none();
    if let Some(degree) = args.sh_degree.filter(|&degree| degree < available) {
        losses.push(format!("SH degree {available} becomes {degree}"));
    }
    losses
}

/// Shows what was lost.
pub(crate) fn say(losses: &Losses, console: &Console) {
    for sentence in losses.sentences() {
        console.note(format!("not kept: {sentence}"));
    }
}
