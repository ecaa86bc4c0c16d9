//! `c4d export`: the scene as files that other tools open.

use super::freeze::{check_sh_degree, existing, output_failure};
use crate::args::{ExportArgs, ExportFormat, Global};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::{frames, scene};
use gs_io::ply::WriteOptions;
use gs_io::ply_sequence;

/// Bytes of a plain zip: players that stream archives know no zip64.
const ZIP_LIMIT: u64 = u32::MAX as u64;
/// Bytes of an entry besides its data, at most.
const ZIP_ENTRY: u64 = 256;

pub(crate) fn run(args: &ExportArgs, global: &Global, console: &Console) -> Outcome {
    let opened = scene::open(&args.scene, global, console)?;
    let times = frames::times(opened.scene.as_ref(), &args.times, args.frames)?;
    if times.len() < 2 {
        return Err(Failure::usage("a sequence needs at least 2 frames")
            .next("For one frame, use c4d freeze --time T."));
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
    match args.to {
        ExportFormat::PlySeq => {
            ply_sequence::write_folder(output, scene, &times, &options, existing(global), &mut step)
        }
        ExportFormat::Zip => {
            ply_sequence::write_zip(output, scene, &times, &options, existing(global), &mut step)
        }
    }
    .map_err(|error| output_failure(&error))?;
    let elapsed = progress.finish();
    let degree = args.sh_degree.unwrap_or(scene.sh_degree());
    console.note(format!(
        "{} frames of {} splats in {:.1} s. 32-bit floats, SH degree {degree}{}; the format has no frame rate: players assume 24 to 30",
        times.len(),
        scene.num_splats(),
        elapsed.as_secs_f64(),
        if degree < scene.sh_degree() { format!(" of {}", scene.sh_degree()) } else { String::new() },
    ));
    console.result(output.display());
    Ok(())
}
