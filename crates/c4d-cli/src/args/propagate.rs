//! Arguments of `c4d propagate`.

use super::{AxesArg, PresetArg, RefineFlags, SceneFlags};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "flags of a command line are independent switches"
)]
pub(crate) struct PropagateArgs {
    /// The dynamic scene
    pub(crate) scene: PathBuf,
    /// The edited frame: 3DGS PLY, compressed PLY, .splat, .spz, .sog or .glb of any editor, or the
    /// output folder of an editor
    #[arg(long, value_name = "FILE")]
    pub(crate) edited: PathBuf,
    /// Run folder to write; with --dry-run, the picture is written to this .png, or next to this
    /// folder
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Time of the edited frame [default: 0]
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) time: Option<f32>,
    /// Axes of an edited SPZ or glTF frame [default: those stated in the file, else those in which
    /// it matches the scene]
    #[arg(long, visible_alias = "spz-axes", value_enum)]
    pub(crate) axes: Option<AxesArg>,
    /// Propagate motion only, without the appearance refinement
    #[arg(long)]
    pub(crate) no_refine: bool,
    /// `default` has the smallest measured error, `paper` follows the paper literally
    #[arg(long, value_enum)]
    pub(crate) preset: Option<PresetArg>,
    /// Options from a TOML file, such as the c4d.toml of a run to repeat; they override the preset,
    /// and flags override them
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Use a baseline instead of the motion model
    #[arg(long, value_enum)]
    pub(crate) baseline: Option<BaselineArg>,
    /// `edited` keeps the exact motion of unedited splats; `all` estimates the motion of all
    /// splats, as the paper does [default: edited; all with --preset paper]
    #[arg(long, value_enum)]
    pub(crate) motion: Option<MotionArg>,
    /// What the edit applies to: the splats of the edited frame only, or their surface, so that
    /// splats of the same surface at other times inherit the edit [default: surface for scenes with
    /// short-lived splats and --preset default; else splats]
    #[arg(long, value_enum)]
    pub(crate) follow: Option<FollowArg>,
    /// Random seed [default: 0]
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// Continue even if the edited file seems to belong to a different scene, or is the whole scene
    /// rotated, scaled or translated
    #[arg(long)]
    pub(crate) allow_far: bool,
    /// If the edited file is the whole scene rotated, scaled or translated, undo the
    /// transformation; the result is in the scene's own frame
    #[arg(long)]
    pub(crate) align: bool,
    /// Add the scene's splats that are missing from the edited file, for example because only a
    /// selection was saved
    #[arg(long)]
    pub(crate) keep_rest: bool,
    /// Only count the splats that the edit kept, changed, added and removed, and write a picture of
    /// the frame before and after
    #[arg(long)]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) common: SceneFlags,
    #[command(flatten)]
    pub(crate) refine: RefineFlags,
}

/// Baselines of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BaselineArg {
    /// Three nearest source splats
    Knn,
    /// The scene's own deformation network, evaluated on the edit
    Deformnet,
}

/// Which splats get estimated motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MotionArg {
    /// Edited splats; the others keep their exact motion
    #[value(alias = "amg")]
    Edited,
    /// All splats
    #[value(alias = "amg-all")]
    All,
}

impl MotionArg {
    /// The name in records.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Edited => "edited",
            Self::All => "all",
        }
    }
}

/// What an edit applies to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FollowArg {
    /// The splats of the edited frame
    Splats,
    /// The surface that they represent
    Surface,
}

impl FollowArg {
    /// The name in records.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Splats => "splats",
            Self::Surface => "surface",
        }
    }
}
