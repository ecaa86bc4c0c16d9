//! The format of an export, and the flags that apply to it.

use crate::args::{ExportArgs, ExportFormat};
use crate::failure::{Failure, Outcome};

/// A flag, the formats to which it applies, and whether it is given.
type Flag = (&'static str, &'static [ExportFormat], fn(&ExportArgs) -> bool);

/// The requested format, or the one implied by the output's name.
pub(super) fn format_of(args: &ExportArgs) -> Outcome<ExportFormat> {
    let format = match args.to {
        Some(format) => format,
        None => ExportFormat::from_file_name(&args.output).ok_or_else(|| {
            Failure::usage(format!(
                "--to is missing, and the name {} does not imply a format",
                args.output.display()
            ))
            .next("--to ply-seq writes a folder of PLYs, --to html a page that plays; c4d export --help lists all.")
        })?,
    };
    check_flags(format, args)?;
    Ok(format)
}

/// Refuses flags that would have no effect.
fn check_flags(to: ExportFormat, args: &ExportArgs) -> Outcome {
    use ExportFormat::{
        CompressedPly, CompressedSeq, Fourdgs, Glb, Gltf, Html, Ply, PlySeq, Splat, Splat4d,
        Splatv, Spz, Usda, Zip,
    };
    const CLIPS: &[ExportFormat] =
        &[PlySeq, Zip, Html, CompressedSeq, Splat4d, Fourdgs, Usda, Splatv];
    const FLAGS: [Flag; 15] = [
        ("--time", &[Ply, CompressedPly, Spz, Splat, Glb, Gltf], |args| args.time.is_some()),
        ("--times", CLIPS, |args| !args.times.is_empty()),
        ("--frames", CLIPS, |args| args.frames.is_some()),
        ("--fps", CLIPS, |args| args.fps.is_some()),
        ("--duration", CLIPS, |args| args.duration.is_some()),
        (
            "--sh-degree above 0",
            &[Ply, PlySeq, Zip, Html, CompressedPly, CompressedSeq, Spz, Glb, Gltf, Fourdgs, Usda],
            |args| args.sh_degree.is_some_and(|degree| degree > 0),
        ),
        ("--no-normals", &[Ply, PlySeq, Zip], |args| args.no_normals),
        ("--tolerance", &[Splat4d, Fourdgs, Splatv], |args| args.tolerance.is_some()),
        ("--force", &[Splatv, Usda], |args| args.force),
        (
            "--up",
            &[Ply, PlySeq, Zip, Html, CompressedPly, CompressedSeq, Splat4d, Usda, Splatv],
            |args| args.up.is_some(),
        ),
        ("--overlay", &[Html], |args| !args.overlay.is_empty()),
        ("--title", &[Html], |args| args.title.is_some()),
        ("--spz-version", &[Spz], |args| args.spz_version.is_some()),
        ("--spz-axes", &[Spz], |args| args.spz_axes.is_some()),
        ("--spz-sh-bits", &[Spz], |args| args.spz_sh_bits.is_some()),
    ];
    for (flag, formats, given) in FLAGS {
        if given(args) && !formats.contains(&to) {
            let names: Vec<String> = formats.iter().map(|format| format.name()).collect();
            return Err(Failure::usage(format!("{flag} does not apply to {}", to.name()))
                .next(format!("Omit it; it applies to {}.", names.join(", "))));
        }
    }
    Ok(())
}
