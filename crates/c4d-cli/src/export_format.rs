//! [`ExportFormat`]: what `c4d export` writes, and which of its flags mean something for which format.

use crate::args::ExportArgs;
use crate::failure::{Failure, Outcome};
use clap::ValueEnum;
use std::path::Path;

/// Formats of exports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportFormat {
    /// A folder of frame_00000.ply …
    PlySeq,
    /// The same in one stored zip
    Zip,
    /// One page that plays in any browser, beside the original if it is a run
    Html,
    /// One frame as 3DGS PLY, every value exact
    Ply,
    /// One frame as PlayCanvas compressed PLY
    CompressedPly,
    /// A folder of such frames, frame_00000.compressed.ply …
    CompressedSeq,
    /// One frame as SPZ
    Spz,
    /// One frame as .splat
    Splat,
    /// One frame as binary glTF with KHR_gaussian_splatting
    Glb,
    /// The same as text, with the data inside
    Gltf,
    /// One .splat4d: compressed, every error bounded, streams
    Splat4d,
    /// One OpenUSD text layer with time samples, exact
    Usda,
    /// One .splatv: a cubic for every splat, for short clips
    Splatv,
}

impl ExportFormat {
    /// Whether it holds one frame.
    pub(crate) fn is_snapshot(self) -> bool {
        matches!(
            self,
            Self::Ply | Self::CompressedPly | Self::Spz | Self::Splat | Self::Glb | Self::Gltf
        )
    }

    /// Whether the whole clip goes into one file that `export_clip` writes.
    pub(crate) fn is_clip(self) -> bool {
        matches!(self, Self::Splat4d | Self::Usda | Self::Splatv)
    }

    /// Name on the command line.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// The format asked for, or the one that the output is called after.
    pub(crate) fn of(args: &ExportArgs) -> Outcome<Self> {
        let format = match args.to {
            Some(format) => format,
            None => Self::called(&args.output).ok_or_else(|| {
                Failure::usage(format!(
                    "--to is missing, and the name {} does not say what to write",
                    args.output.display()
                ))
                .next("--to ply-seq writes a folder of PLYs, --to html a page that plays; c4d export --help lists all.")
            })?,
        };
        format.check_flags(args)?;
        Ok(format)
    }

    /// The format of files with this name.
    fn called(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        let named = |(ending, format): &(&str, Self)| name.ends_with(ending).then_some(*format);
        ENDINGS.iter().find_map(named)
    }

    /// Refuses flags that would change nothing: whoever gives them expects that they do.
    fn check_flags(self, args: &ExportArgs) -> Outcome {
        use ExportFormat::{
            CompressedPly, CompressedSeq, Glb, Gltf, Html, Ply, PlySeq, Splat, Splat4d, Splatv,
            Spz, Usda, Zip,
        };
        const CLIPS: &[ExportFormat] = &[PlySeq, Zip, Html, CompressedSeq, Splat4d, Usda, Splatv];
        const FLAGS: [Flag; 14] = [
            ("--time", &[Ply, CompressedPly, Spz, Splat, Glb, Gltf], |args| args.time.is_some()),
            ("--times", CLIPS, |args| !args.times.is_empty()),
            ("--frames", CLIPS, |args| args.frames.is_some()),
            ("--fps", CLIPS, |args| args.fps.is_some()),
            ("--duration", CLIPS, |args| args.duration.is_some()),
            (
                "--sh-degree above 0",
                &[Ply, PlySeq, Zip, Html, CompressedPly, CompressedSeq, Spz, Glb, Gltf, Usda],
                |args| args.sh_degree.is_some_and(|degree| degree > 0),
            ),
            ("--no-normals", &[Ply, PlySeq, Zip], |args| args.no_normals),
            ("--tolerance", &[Splat4d, Splatv], |args| args.tolerance.is_some()),
            ("--force", &[Splatv, Usda], |args| args.force),
            (
                "--up",
                &[Ply, PlySeq, Zip, Html, CompressedPly, CompressedSeq, Splat4d, Usda, Splatv],
                |args| args.up.is_some(),
            ),
            ("--title", &[Html], |args| args.title.is_some()),
            ("--spz-version", &[Spz], |args| args.spz_version.is_some()),
            ("--spz-axes", &[Spz], |args| args.spz_axes.is_some()),
            ("--spz-sh-bits", &[Spz], |args| args.spz_sh_bits.is_some()),
        ];
        for (flag, formats, given) in FLAGS {
            if given(args) && !formats.contains(&self) {
                let names: Vec<String> = formats.iter().map(|format| format.name()).collect();
                return Err(Failure::usage(format!("{flag} means nothing for {}", self.name()))
                    .next(format!("Leave it out; it is for {}.", names.join(", "))));
            }
        }
        Ok(())
    }
}

/// A flag, the formats that heed it, and whether it is given.
type Flag = (&'static str, &'static [ExportFormat], fn(&ExportArgs) -> bool);

/// Endings of names that one format alone has.
const ENDINGS: [(&str, ExportFormat); 12] = [
    (".splat4d", ExportFormat::Splat4d),
    (".splatv", ExportFormat::Splatv),
    (".splat", ExportFormat::Splat),
    (".usda", ExportFormat::Usda),
    (".html", ExportFormat::Html),
    (".htm", ExportFormat::Html),
    (".zip", ExportFormat::Zip),
    (".spz", ExportFormat::Spz),
    (".glb", ExportFormat::Glb),
    (".gltf", ExportFormat::Gltf),
    (".compressed.ply", ExportFormat::CompressedPly),
    (".ply", ExportFormat::Ply),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_the_format_where_only_one_has_it() {
        let called = |name: &str| ExportFormat::called(Path::new(name));
        assert_eq!(called("a/Clip.SPLAT4D"), Some(ExportFormat::Splat4d), "whatever the case");
        assert_eq!(called("clip.splatv"), Some(ExportFormat::Splatv), "not its shorter cousin");
        assert_eq!(called("one.compressed.ply"), Some(ExportFormat::CompressedPly), "two dots");
        assert_eq!(called("one.ply"), Some(ExportFormat::Ply), "one frame");
        for name in ["frames", "frames/", "clip.mp4", "..", ""] {
            assert_eq!(called(name), None, "{name}");
        }
    }
}
