//! Arguments of `c4d export`.

use super::export_format::ExportFormat;
use super::overlay::OverlayArg;
use super::shared::SceneFlags;
use super::views::{AxesArg, Up};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// The dynamic scene or run
    pub(crate) scene: PathBuf,
    /// Format to write [default: by the output's name: .splat4d, .4dgs, .splatv, .usda, .html,
    /// .zip, .spz, .splat, .glb, .gltf, .compressed.ply or .ply]
    #[arg(long, value_enum)]
    pub(crate) to: Option<ExportFormat>,
    /// Folder (ply-seq, compressed-seq) or file
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Number of frames, evenly spaced over the whole clip [default: that of the sequence, else 60]
    #[arg(long, help_heading = "Frames")]
    pub(crate) frames: Option<usize>,
    /// Times, comma-separated
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "T,…",
        conflicts_with = "frames",
        allow_negative_numbers = true,
        help_heading = "Frames"
    )]
    pub(crate) times: Vec<f32>,
    /// Time of the frame for ply, compressed-ply, spz, splat, glb and gltf [default: 0]
    #[arg(
        long,
        value_name = "T",
        allow_negative_numbers = true,
        conflicts_with_all = ["times", "frames"],
        help_heading = "Frames"
    )]
    pub(crate) time: Option<f32>,
    /// Frames per second of a clip; for sequences, it is stored in the manifest [default: the rate
    /// at which the frames last as long as the clip]
    #[arg(long, allow_negative_numbers = true, help_heading = "Frames")]
    pub(crate) fps: Option<f64>,
    /// Length of the whole clip [default: that of the scene, its
    /// frames at its own rate or at 30 per second]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, help_heading = "Frames")]
    pub(crate) duration: Option<f64>,
    /// Keep SH only up to this degree [default: all; html: 1; splat,
    /// splat4d and splatv store only degree 0]
    #[arg(long, value_name = "0-3", help_heading = "Content")]
    pub(crate) sh_degree: Option<usize>,
    /// ply, ply-seq, zip: omit the unused normals (12 bytes per splat; some readers need them)
    #[arg(long, help_heading = "Content")]
    pub(crate) no_normals: bool,
    /// splat4d, 4dgs, splatv: largest position error as a share of the scene's size [default:
    /// splat4d and 4dgs 0.0002; splatv 0.005, exceeded by at most one splat in a hundred]
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true, help_heading = "Content")]
    pub(crate) tolerance: Option<f64>,
    /// splatv, usda: write the file even if cubic polynomials do not
    /// fit the motion, or the text is very large
    #[arg(long, help_heading = "Content")]
    pub(crate) force: bool,
    /// html: overlays that the page offers
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "NAME,…",
        help_heading = "Content"
    )]
    pub(crate) overlay: Vec<OverlayArg>,
    /// The world's upward direction to store in the file [default: that of the scene]
    #[arg(long, value_enum, allow_hyphen_values = true, help_heading = "Metadata")]
    pub(crate) up: Option<Up>,
    /// html: title of the page [default: the output's name]
    #[arg(long, help_heading = "Metadata")]
    pub(crate) title: Option<String>,
    /// spz: version 3, or 4, which few viewers support yet [default: 3]
    #[arg(long, value_name = "3|4", help_heading = "SPZ")]
    pub(crate) spz_version: Option<u32>,
    /// spz: axes of the file [default: rub, as specified; splat-transform 3 and gsply expect ply]
    #[arg(long, value_enum, help_heading = "SPZ")]
    pub(crate) spz_axes: Option<AxesArg>,
    /// spz: bits of SH coefficients, 1 to 8, or of degree 1 and of higher degrees [default: 5,4]
    #[arg(long, value_name = "N[,N]", value_parser = parse_bits, help_heading = "SPZ")]
    pub(crate) spz_sh_bits: Option<[u32; 2]>,
    #[command(flatten)]
    pub(crate) common: SceneFlags,
}

fn parse_bits(text: &str) -> Result<[u32; 2], String> {
    let bits = |part: &str| part.trim().parse().ok().filter(|bits| (1..=8).contains(bits));
    let (first, above) = text.split_once(',').unwrap_or((text, text));
    bits(first)
        .and_then(|first| Some([first, bits(above)?]))
        .ok_or_else(|| format!("invalid bits `{text}`: expected 1 to 8, for example 8 or 5,4"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_sh() {
        assert_eq!((parse_bits("8"), parse_bits("5, 4")), (Ok([8, 8]), Ok([5, 4])), "bits");
        assert!(parse_bits("9").is_err() && parse_bits("3,0").is_err(), "bits out of range");
    }
}
