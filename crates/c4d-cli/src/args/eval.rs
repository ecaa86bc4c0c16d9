//! Arguments of `c4d eval`.

use super::{SceneFlags, SplitArg, Up};
use crate::part::Share;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Views, frames and ground truth of a measurement, in `c4d eval` and `c4d compare`.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Views and frames")]
pub(crate) struct MeasureFlags {
    /// Cameras, as `c4d render --cameras`; each is used at every frame [default: two views of a rig
    /// around the scene]
    #[arg(long, value_name = "PATH")]
    pub(crate) cameras: Option<PathBuf>,
    /// Only these views of the cameras: names, cameras (cam00), or indices
    #[arg(long, value_delimiter = ',', value_name = "NAME,…")]
    pub(crate) views: Vec<String>,
    /// Views of a data set [default: test, else all; at most 8, evenly spaced]
    #[arg(long, value_enum)]
    pub(crate) split: Option<SplitArg>,
    /// Ground truth: another scene or run, or the folder with the photographs of the data set in
    /// --cameras
    #[arg(long, value_name = "SCENE|IMAGES")]
    pub(crate) truth: Option<PathBuf>,
    /// Times, comma-separated [default: those of the cameras, if they have several, else as
    /// --frames]
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
    /// Image size [default: that of the cameras, 480x360 for the rig]
    #[arg(long, value_name = "WxH", value_parser = super::values::parse_size)]
    pub(crate) size: Option<(u32, u32)>,
    /// Background colour [default: that of the model's training, else black]
    #[arg(long, value_name = "R,G,B", value_parser = super::values::parse_background)]
    pub(crate) background: Option<[f32; 3]>,
    /// The world's upward direction, for the rig
    #[arg(long, value_enum, allow_hyphen_values = true)]
    pub(crate) up: Option<Up>,
}

#[derive(Debug, Args)]
pub(crate) struct EvalArgs {
    /// The run to measure; or a scene, to compare with --truth
    pub(crate) run: PathBuf,
    /// JSON file for all values with their parameters; a table is always printed
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Metrics and groups to measure: core, all, truth, preservation, time, neural, motion,
    /// matches, cost, or single metrics [default: core; all with --weights]
    #[arg(long, value_delimiter = ',', value_name = "core|all|NAME,…")]
    pub(crate) metrics: Vec<String>,
    /// Propagate an edit with each variant of the paper's ablations and with the defaults, measure
    /// each run, and print one table; pass a scene instead of the run, and the folder for the runs
    /// with -o
    #[arg(long, requires = "edited", requires = "output")]
    pub(crate) ablation: bool,
    /// The edited frame of --ablation
    #[arg(long, value_name = "FILE")]
    pub(crate) edited: Option<PathBuf>,
    /// Time of the edited frame of --ablation
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, requires = "ablation")]
    pub(crate) time: f32,
    /// Also vary the weights of the paper's transport (λ0 0.05 to 0.3, λ1 and λ2 0.6 to 11)
    #[arg(long, requires = "ablation")]
    pub(crate) sweep: bool,
    /// Number of images of each refinement of --ablation [default: 60; 240 where the paper's preset is used]
    #[arg(long, value_name = "N", requires = "ablation")]
    pub(crate) samples: Option<usize>,
    /// Size of these images [default: that of the cameras, 640x480 for the rig]
    #[arg(long, value_name = "WxH", value_parser = super::values::parse_size, requires = "ablation")]
    pub(crate) refine_size: Option<(u32, u32)>,
    /// Only write the input of a learned judge: pictures before and after, and jobs.jsonl
    /// (editscore: pairs of 30 frames; vebench: clips as folders of frames)
    #[arg(
        long,
        num_args = 2,
        value_names = ["editscore|vebench", "DIR"],
        requires = "prompt",
        conflicts_with_all = ["ablation", "output"]
    )]
    pub(crate) emit: Vec<String>,
    /// Description of the edited scene, for CLIP; with --emit, the editing instruction
    #[arg(long, value_name = "TEXT")]
    pub(crate) prompt: Option<String>,
    /// Description of the source, for CLIP's directional similarity
    #[arg(long, value_name = "TEXT", conflicts_with = "emit")]
    pub(crate) source_prompt: Option<String>,
    /// Folder with weights of CLIP, DINO, AlexNet or VGG-16, and LPIPS heads, for neural metrics
    #[arg(long, value_name = "DIR", conflicts_with = "emit")]
    pub(crate) weights: Option<PathBuf>,
    /// Add the scores of a learned judge: lines of {"id": …, "scores": {NAME: NUMBER}}
    #[arg(long, value_name = "SCORES.JSONL", conflicts_with = "ablation")]
    pub(crate) ingest: Option<PathBuf>,
    /// Measure only the K-th of N equal parts of the views; `c4d gather` joins the parts
    #[arg(
        long,
        value_name = "K/N",
        value_parser = Share::parse,
        requires = "output",
        conflicts_with_all = ["ablation", "emit", "ingest"]
    )]
    pub(crate) part: Option<Share>,
    #[command(flatten)]
    pub(crate) measure: MeasureFlags,
    #[command(flatten)]
    pub(crate) common: SceneFlags,
}

/// Learned judges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum JudgeArg {
    /// Pairs of pictures and the instruction
    Editscore,
    /// Pairs of clips and the instruction
    Vebench,
}
