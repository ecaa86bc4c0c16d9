//! Arguments of `c4d render`.

use super::values::{Crop, parse_background, parse_crop, parse_size};
use super::{AxesArg, CamerasAs, OverlayArg, SceneFlags, SplitArg, Up};
use crate::part::Share;
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// The dynamic scene or run, or one frame: the edited file of any editor
    pub(crate) scene: PathBuf,
    /// front, orbit, spiral, or a file or folder with cameras: a data set
    /// (D-NeRF, HyperNeRF, DyNeRF, COLMAP, MeetRoom, multiple-view), a
    /// `cameras.json`, or a model folder that contains or names one
    #[arg(long, default_value = "front", value_name = "PATH|front|orbit|spiral")]
    pub(crate) cameras: String,
    /// Only these views of the cameras: names, cameras (cam00), or indices
    #[arg(long, value_delimiter = ',', value_name = "NAME,…")]
    pub(crate) views: Vec<String>,
    /// Views of a data set [default: test, else all]
    #[arg(long, value_enum)]
    pub(crate) split: Option<SplitArg>,
    /// How a data set's cameras are read [default: trained for 4DGS and Swift4D models and their
    /// runs, else stored]
    #[arg(long, value_enum)]
    pub(crate) cameras_as: Option<CamerasAs>,
    /// Times, comma-separated [default: those of the cameras, if they have any, else as --frames]
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "T,…",
        conflicts_with = "frames",
        allow_negative_numbers = true
    )]
    pub(crate) times: Vec<f32>,
    /// Number of frames, evenly spaced over the whole clip [default: that of the sequence, else 60]
    #[arg(long)]
    pub(crate) frames: Option<usize>,
    /// Axes of an SPZ or glTF frame [default: those stated in the file, else those of its format]
    #[arg(long, visible_alias = "spz-axes", value_enum)]
    pub(crate) axes: Option<AxesArg>,
    /// Image size [default: that of the cameras, else 960x720]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) size: Option<(u32, u32)>,
    /// What to render
    #[arg(long, value_enum, value_delimiter = ',', default_value = "rgb")]
    pub(crate) passes: Vec<Pass>,
    /// File format [default: from the output's name, else png]
    #[arg(long, value_enum)]
    pub(crate) format: Option<Format>,
    /// Folder (png, exr, npy, flo) or file (mp4, webp, gif, sheet)
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Frames per second of videos [default: the rate at which the frames last as long as the clip]
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) fps: Option<f64>,
    /// Length of videos of the whole clip [default: that of the clip, its
    /// frames at its own rate or at 30 per second]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub(crate) duration: Option<f64>,
    /// Only this part of the images: size, and column and row of its first pixel
    #[arg(long, value_name = "WxH+X+Y", value_parser = parse_crop)]
    pub(crate) crop: Option<Crop>,
    /// Runs only: show the source scene on the left, or with =unrefined the run before refinement
    #[arg(
        long,
        value_enum,
        value_name = "LEFT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "original"
    )]
    pub(crate) side_by_side: Option<LeftHalf>,
    /// Background colour [default: that of the model's training, else black]
    #[arg(long, value_name = "R,G,B", value_parser = parse_background)]
    pub(crate) background: Option<[f32; 3]>,
    /// The world's upward direction, for front, orbit and spiral
    #[arg(long, value_enum, allow_hyphen_values = true)]
    pub(crate) up: Option<Up>,
    /// Render only the K-th of N equal parts, into a folder; `c4d gather` joins the parts
    #[arg(long, value_name = "K/N", value_parser = Share::parse)]
    pub(crate) part: Option<Share>,
    #[command(flatten)]
    pub(crate) common: SceneFlags,
}

/// Left half of `c4d render --side-by-side`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LeftHalf {
    /// The scene before the edit
    Original,
    /// The edited scene before its refinement
    Unrefined,
}

/// Kinds of images to render.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Pass {
    /// Colour
    Rgb,
    /// Coverage
    Alpha,
    /// Camera depth Σ zαT
    Depth,
    /// Motion since the edited frame, pixels (Eq. 12)
    Flow,
    /// Colour uncertainty since the edited frame (Eq. 16), from view dependence and from splats
    /// hidden in frame 1
    Uncertainty,
    /// The part of the uncertainty that comes from splats hidden in frame 1
    Evidence,
    /// Artifact mask (Eq. 17)
    Mask,
    /// Parts that move rigidly, as `part N` of c4d edit selects them
    Parts,
    /// Largest distance from the position at the edited frame; exr and npy: world units
    Motion,
    /// Runs: how well the source determines the motion; exr and npy: 0 to 1
    Confidence,
    /// Runs: what the edit changed
    Changed,
}

impl Pass {
    /// Whether the pass compares a frame with the edited one.
    pub(crate) fn is_relative(self) -> bool {
        matches!(self, Self::Flow | Self::Uncertainty | Self::Evidence | Self::Mask)
    }

    /// Whether the pass needs the evidence of frame 1.
    pub(crate) fn needs_evidence(self) -> bool {
        matches!(self, Self::Uncertainty | Self::Evidence | Self::Mask)
    }

    /// The overlay that it shows, if it shows one.
    pub(crate) fn overlay(self) -> Option<OverlayArg> {
        match self {
            Self::Parts => Some(OverlayArg::Parts),
            Self::Motion => Some(OverlayArg::Motion),
            Self::Confidence => Some(OverlayArg::Confidence),
            Self::Changed => Some(OverlayArg::Changed),
            _ => None,
        }
    }

    /// Folder and file-name part.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Alpha => "alpha",
            Self::Depth => "depth",
            Self::Flow => "flow",
            Self::Uncertainty => "uncertainty",
            Self::Evidence => "evidence",
            Self::Mask => "mask",
            Self::Parts => "parts",
            Self::Motion => "motion",
            Self::Confidence => "confidence",
            Self::Changed => "changed",
        }
    }
}

/// Formats of renders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Format {
    /// 8 bits; depth scaled to its range
    Png,
    /// 32-bit float
    Exr,
    /// NumPy array of 32-bit floats
    Npy,
    /// Middlebury flow
    Flo,
    /// H.264 video, built-in encoder
    Mp4,
    /// Lossless animated WebP that loops
    Webp,
    /// Animated GIF that loops, 255 colours per frame
    Gif,
    /// One PNG with up to twelve frames side by side
    Sheet,
}
