//! Arguments of `c4d refine`, and its flags in `c4d propagate`.

use super::values::parse_size;
use super::{OutputFlags, PresetArg, Up};
use crate::failure::{Failure, Outcome};
use crate::part::Share;
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Flags of the appearance refinement, in `c4d propagate` and `c4d refine`.
#[derive(Debug, Clone, Args, Serialize, Deserialize)]
#[command(next_help_heading = "Appearance refinement")]
#[serde(default)]
pub(crate) struct RefineFlags {
    /// Cameras to refine from, as `c4d render --cameras`; each is used at every time [default: a
    /// rig around the scene]
    #[arg(long, visible_alias = "cameras", value_name = "PATH")]
    pub(crate) refine_cameras: Option<PathBuf>,
    /// Size of the images [default: that of the cameras, 640x480 for the rig]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) refine_size: Option<(u32, u32)>,
    /// The world's upward direction, for the rig
    #[arg(long, value_enum, allow_hyphen_values = true)]
    pub(crate) refine_up: Option<Up>,
    /// Times to draw images from, evenly spaced [default: 30]
    #[arg(long, value_name = "N")]
    pub(crate) refine_frames: Option<usize>,
    /// Images to draw (view and time) [default: 60; 240 with --preset paper]
    #[arg(long, value_name = "N")]
    pub(crate) samples: Option<usize>,
    /// ε of the artifact mask, 0 to 10: pixels whose uncertainty is above ε times its mean are
    /// masked [default: 0.5; the paper uses 0.5 to 2]
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) epsilon: Option<f32>,
    /// How frame 1 is warped to other frames [default: backward; paper with --preset paper]
    #[arg(long, value_enum)]
    pub(crate) warp: Option<WarpArg>,
    /// Memory for images, MiB, 16 or more [default: 2048, or half of the free memory if less]
    #[arg(long, value_name = "MIB")]
    pub(crate) memory: Option<usize>,
    /// Interval at which a preview image is written into the run [default: none is written]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub(crate) preview_every: Option<f64>,
    /// Interval between checkpoints for --resume
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0, allow_negative_numbers = true)]
    pub(crate) checkpoint_every: f64,
}

impl RefineFlags {
    /// The same flags, for use from another working folder.
    pub(crate) fn absolute(&self) -> Outcome<Self> {
        let absolute = |path: &PathBuf| std::path::absolute(path).map_err(Failure::failed);
        let refine_cameras = self.refine_cameras.as_ref().map(absolute).transpose()?;
        Ok(Self { refine_cameras, ..self.clone() })
    }
}

impl Default for RefineFlags {
    fn default() -> Self {
        Self {
            refine_cameras: None,
            refine_size: None,
            refine_up: None,
            refine_frames: None,
            samples: None,
            epsilon: None,
            warp: None,
            memory: None,
            preview_every: None,
            checkpoint_every: 20.0,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct RefineArgs {
    /// The run folder; its colours are replaced, its motion is kept
    pub(crate) run: PathBuf,
    /// `default` has the smallest measured error, `paper` follows the paper literally
    #[arg(long, value_enum)]
    pub(crate) preset: Option<PresetArg>,
    /// Options from the section `refine` of a TOML file, such as the c4d.toml of a run; they
    /// override the preset, and flags override them
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Continue from the checkpoint of an interrupted refinement with the same flags
    #[arg(long)]
    pub(crate) resume: bool,
    /// Compute only the K-th of N equal parts of the images, in the folder -o; `c4d gather` joins
    /// the parts and refines the run
    #[arg(long, value_name = "K/N", value_parser = Share::parse, requires = "output", conflicts_with = "resume")]
    pub(crate) part: Option<Share>,
    /// Folder of --part
    #[arg(short, long, value_name = "FOLDER", requires = "part")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) common: OutputFlags,
    #[command(flatten)]
    pub(crate) flags: RefineFlags,
}

/// Forms of Eq. 13.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
pub(crate) enum WarpArg {
    /// Colours are fetched through the flow at the pixels of frame t, with an occlusion test
    Backward,
    /// As printed in the paper (Eq. 13)
    Paper,
}
