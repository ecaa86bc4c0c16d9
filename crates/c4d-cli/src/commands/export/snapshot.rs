//! Formats of one frame.

use super::messages::{note_written, plain_losses};
use crate::args::{AxesArg, ExportArgs, ExportFormat, Global};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames;
use crate::output::{check_sh_degree, existing, output_failure, refuse_overlap};
use crate::scene::LoadedScene;
use gs_io::ply::comments;
use gs_io::{AtomicFile, compressed_ply, gltf, ply, splat_file, spz};
use std::time::Instant;

/// Writes the frame at `--time`.
pub(super) fn write(
    args: &ExportArgs,
    to: ExportFormat,
    opened: &LoadedScene,
    global: &Global,
    console: &Console,
) -> Outcome {
    let time = args.time.unwrap_or_default();
    frames::check(opened.scene.time_range(), time, "--time")?;
    check_sh_degree(args.sh_degree, opened.scene.sh_degree())?;
    let spz = spz_options(args)?;
    refuse_overlap(&args.output, &opened.roots)?;
    let start = Instant::now();
    let splats = opened.scene.at(time).map_err(Failure::input)?;
    let mut file = AtomicFile::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let comments = std::iter::once(format!("{}{time}", comments::TIME))
        .chain(comments::up_comments(opened.up))
        .collect();
    let sh_degree = args.sh_degree;
    let written = match to {
        ExportFormat::Splat => splat_file::write(&splats, &mut file),
        ExportFormat::Spz => spz::write(&splats, &spz, &mut file),
        ExportFormat::Ply => {
            let options = ply::WriteOptions { normals: !args.no_normals, comments, sh_degree };
            ply::write(&splats, &options, &mut file)
                .map(|()| plain_losses(args, opened.scene.sh_degree()))
        }
        ExportFormat::Glb | ExportFormat::Gltf => {
            let text = to == ExportFormat::Gltf;
            let options = gltf::WriteOptions { sh_degree, text, comments };
            gltf::write(&splats, &options, &mut file)
        }
        _ => {
            let order = Some(compressed_ply::morton_order(&splats));
            let options = compressed_ply::WriteOptions { comments, sh_degree, order };
            compressed_ply::write(&splats, &options, &mut file)
        }
    };
    let losses = written.map_err(|error| Failure::write(&args.output, &error))?;
    file.commit().map_err(|error| output_failure(&error))?;
    let what = format!("{} splats at time {time}", splats.len());
    note_written(&args.output, start.elapsed(), &what, &losses, console);
    Ok(())
}

fn spz_options(args: &ExportArgs) -> Outcome<spz::WriteOptions> {
    let mut options = spz::WriteOptions { sh_degree: args.sh_degree, ..Default::default() };
    if let Some(version) = args.spz_version {
        if !(3..=4).contains(&version) {
            return Err(Failure::usage(format!("--spz-version {version}: expected 3 or 4")));
        }
        options.version = version;
    }
    options.axes = args.spz_axes.map_or(options.axes, AxesArg::axes);
    options.sh_bits = args.spz_sh_bits.unwrap_or(options.sh_bits);
    Ok(options)
}
