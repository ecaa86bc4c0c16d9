//! [`ExportFormat`]: formats of `c4d export`.

use clap::ValueEnum;
use std::path::Path;

/// Formats of exports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExportFormat {
    /// A folder of frame_00000.ply …
    PlySeq,
    /// The same PLYs in one uncompressed zip
    Zip,
    /// One page that plays in any browser; for a run, with a comparison to the original
    Html,
    /// One frame as 3DGS PLY, every value exact
    Ply,
    /// One frame as PlayCanvas compressed PLY
    CompressedPly,
    /// A folder of compressed PLYs, frame_00000.compressed.ply …
    CompressedSeq,
    /// One frame as SPZ
    Spz,
    /// One frame as .splat
    Splat,
    /// One frame as binary glTF with KHR_gaussian_splatting
    Glb,
    /// One frame as glTF text with KHR_gaussian_splatting and embedded data
    Gltf,
    /// One .splat4d: compressed, with bounded errors, streamable
    Splat4d,
    /// One .4dgs: rows that move along lines and fade, several per splat where needed
    #[value(name = "4dgs")]
    Fourdgs,
    /// One OpenUSD text layer with time samples, exact
    Usda,
    /// One .splatv: a cubic polynomial per splat, for short clips
    Splatv,
}

impl ExportFormat {
    /// Whether the format stores one frame.
    pub(crate) fn is_snapshot(self) -> bool {
        matches!(
            self,
            Self::Ply | Self::CompressedPly | Self::Spz | Self::Splat | Self::Glb | Self::Gltf
        )
    }

    /// Whether the format stores the whole clip in one file, written by `export_clip`.
    pub(crate) fn is_clip(self) -> bool {
        matches!(self, Self::Splat4d | Self::Fourdgs | Self::Usda | Self::Splatv)
    }

    /// Name on the command line.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// The format of files with this name.
    pub(crate) fn from_file_name(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        let named = |(ending, format): &(&str, Self)| name.ends_with(ending).then_some(*format);
        ENDINGS.iter().find_map(named)
    }
}

/// File extensions that identify a format.
const ENDINGS: [(&str, ExportFormat); 13] = [
    (".splat4d", ExportFormat::Splat4d),
    (".4dgs", ExportFormat::Fourdgs),
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
    fn unique_extensions_imply_the_format() {
        let format = |name: &str| ExportFormat::from_file_name(Path::new(name));
        assert_eq!(format("a/Clip.SPLAT4D"), Some(ExportFormat::Splat4d), "ignoring case");
        assert_eq!(format("clip.splatv"), Some(ExportFormat::Splatv), "not the shorter extension");
        assert_eq!(format("one.compressed.ply"), Some(ExportFormat::CompressedPly), "two dots");
        assert_eq!(format("one.ply"), Some(ExportFormat::Ply), "one frame");
        for name in ["frames", "frames/", "clip.mp4", "..", ""] {
            assert_eq!(format(name), None, "{name}");
        }
    }
}
