//! Formats of one frame.

use super::super::freeze::{TIME_COMMENT, check_sh_degree, existing, output_failure};
use super::say;
use crate::args::{ExportArgs, ExportFormat, Global};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames;
use crate::scene::{self, Opened};
use gs_io::{AtomicFile, compressed_ply, splat_file, spz};

/// Writes the frame at `--time`.
pub(super) fn write(
    args: &ExportArgs,
    opened: &Opened,
    global: &Global,
    console: &Console,
) -> Outcome {
    frames::check(opened.scene.time_range(), args.time, "--time")?;
    check_sh_degree(args.sh_degree, opened.scene.sh_degree())?;
    if !(3..=4).contains(&args.spz_version) {
        return Err(Failure::usage(format!("--spz-version {}: expected 3 or 4", args.spz_version)));
    }
    scene::refuse_overlap(&args.output, &opened.roots)?;
    let splats = opened.scene.at(args.time).map_err(Failure::bad_input)?;
    let mut file = AtomicFile::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let written = match args.to {
        ExportFormat::Splat => splat_file::write(&splats, &mut file),
        ExportFormat::Spz => {
            let options =
                spz::WriteOptions { version: args.spz_version, sh_degree: args.sh_degree };
            spz::write(&splats, &options, &mut file)
        }
        _ => {
            let comments = std::iter::once(format!("{TIME_COMMENT}{}", args.time))
                .chain(scene::up_comments(opened.up))
                .collect();
            let order = Some(compressed_ply::morton_order(&splats));
            let options =
                compressed_ply::WriteOptions { comments, sh_degree: args.sh_degree, order };
            compressed_ply::write(&splats, &options, &mut file)
        }
    };
    let losses = written.map_err(|error| Failure::write(&args.output, &error))?;
    file.commit().map_err(|error| output_failure(&error))?;
    console.note(format!("{} splats at time {}", splats.len(), args.time));
    say(&losses, console);
    console.result(args.output.display());
    Ok(())
}
