//! The command line.

mod bench;
mod compare;
mod edit;
mod eval;
mod export;
mod export_format;
mod freeze;
mod inspect;
mod shared;
mod shell;
mod views;

pub(crate) use bench::{BenchCommand, BenchMotionArgs};
pub(crate) use compare::CompareArgs;
pub(crate) use edit::EditArgs;
pub(crate) use eval::{EvalArgs, JudgeArg, MeasureFlags};
pub(crate) use export::ExportArgs;
pub(crate) use export_format::ExportFormat;
pub(crate) use freeze::FreezeArgs;
pub(crate) use inspect::{DoctorArgs, InfoArgs};
pub(crate) use shared::{
    Bars, Common, Global, ModelFlags, OutputFlags, Overwriting, Rendering, SceneFlags,
};
pub(crate) use shell::{CompletionsArgs, ManArgs};
pub(crate) use views::{AxesArg, CamerasAs, SplitArg, Up};

use crate::failure::{Failure, Outcome};
use clap::{Args, Parser, Subcommand, ValueEnum};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

const AFTER_HELP: &str = "\
Exit codes: 0 done, 1 failed, 2 usage, 3 bad input file, 4 no such GPU, 6 finished with warnings under --strict, 130 interrupted.

SCENE is a trained scene (4DGaussians, Swift4D, Deformable-3D-Gaussians, SC-GS, Grid4D, DASH, E-D3DGS, native 4D Gaussians, FreeTimeGS, Spacetime Gaussians, Dynamic 3D Gaussians), a folder or zip archive of numbered PLYs with persistent rows, a .splatv or .splat4d clip, or a RUN folder of `c4d propagate`.";

/// Propagate an edit of one frame of a dynamic Gaussian-splat scene to all other times.
#[derive(Debug, Parser)]
#[command(name = "c4d", version, after_help = AFTER_HELP)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,

    #[command(flatten)]
    pub(crate) common: Common,
}

impl Cli {
    /// The shared flags of the command.
    pub(crate) fn global(&self) -> Global {
        let global = Global::of(&self.common);
        match &self.command {
            Command::Info(args) => global.model(&args.model),
            Command::Doctor(args) => global.rendering(&args.rendering),
            Command::Freeze(args) => global.scene(&args.common),
            Command::Edit(args) => global.scene(&args.common),
            Command::Propagate(args) => global.scene(&args.common),
            Command::Refine(args) => global.bars(&args.bars).rendering(&args.rendering),
            Command::Render(args) => global.scene(&args.common),
            Command::Export(args) => global.scene(&args.common),
            Command::Eval(args) => global.scene(&args.common),
            Command::Compare(args) => global.output(&args.common),
            Command::Demo(args) => global.output(&args.common),
            Command::Bench { what: BenchCommand::Motion(args) } => {
                global.writes(&args.writes).bars(&args.bars)
            }
            Command::Completions(_) => global,
            Command::Man(args) => global.writes(&args.writes),
        }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show what a file or folder is, what is missing and what to do with it
    Info(InfoArgs),
    /// Check that this machine can run c4d, and how fast
    Doctor(DoctorArgs),
    /// Write the splats of one time as a PLY for any 3D editor, with cameras
    Freeze(FreezeArgs),
    /// Edit a frame: by selections and actions, or fit it to edited pictures of it
    Edit(EditArgs),
    /// Carry an edited frame through all of time
    Propagate(PropagateArgs),
    /// Repair the colours that motion reveals in a run (c4d propagate does this too)
    Refine(RefineArgs),
    /// Render images or a video
    Render(RenderArgs),
    /// Write frames and clips for other tools, or a page that plays in any browser
    Export(ExportArgs),
    /// Measure a run: what it keeps, how it moves, how it compares with the truth
    Eval(EvalArgs),
    /// Show runs side by side in one page: where to look first, pictures, curves, numbers
    Compare(CompareArgs),
    /// Make a synthetic scene, edit it, propagate the edit and render both, without any input
    Demo(DemoArgs),
    /// Measure methods against ground truth
    Bench {
        #[command(subcommand)]
        what: BenchCommand,
    },
    /// Print the completions of a shell
    Completions(CompletionsArgs),
    /// Write manual pages, one per command
    Man(ManArgs),
}

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "flags of a command line are independent switches"
)]
pub(crate) struct PropagateArgs {
    /// The dynamic scene
    pub(crate) scene: PathBuf,
    /// The edited frame: 3DGS PLY, compressed PLY, .splat, .spz, .sog or .glb of any editor, or the
    /// run folder of one
    #[arg(long, value_name = "FILE")]
    pub(crate) edited: PathBuf,
    /// Run folder to write; with --dry-run, the picture beside it, or a .png
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Time of the edited frame [default: 0]
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) time: Option<f32>,
    /// Axes of an edited SPZ or glTF frame [default: those it names, else those in which it matches
    /// the scene]
    #[arg(long, visible_alias = "spz-axes", value_enum)]
    pub(crate) axes: Option<AxesArg>,
    /// Motion only: leave out the appearance refinement
    #[arg(long)]
    pub(crate) no_refine: bool,
    /// `best` is what measured best, `paper` the paper to the letter [default: best]
    #[arg(long, value_enum)]
    pub(crate) preset: Option<PresetArg>,
    /// Options from a TOML file, such as the c4d.toml of a run to repeat; flags win over it, it
    /// over the preset
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Use a baseline instead of anchors and transport
    #[arg(long, value_enum)]
    pub(crate) baseline: Option<BaselineArg>,
    /// `amg` keeps the exact motion of splats that were not edited; `amg-all` estimates all anew,
    /// as the paper does [default: amg; amg-all with --preset paper]
    #[arg(long, value_enum)]
    pub(crate) motion: Option<MotionArg>,
    /// What the edit belongs to: the splats of its frame, or the surface they show, so that splats
    /// that stand for it at other times inherit the edit [default: surface where splats live for a
    /// part of the clip, with --preset best; else splats]
    #[arg(long, value_enum)]
    pub(crate) follow: Option<FollowArg>,
    /// Seed of everything random [default: 0]
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// Go on although the edited file seems to belong to another scene, or is the whole scene
    /// turned, scaled or moved
    #[arg(long)]
    pub(crate) allow_far: bool,
    /// If the edited file is the scene turned, scaled or moved as a whole, undo that: the result is
    /// in the scene's own frame
    #[arg(long)]
    pub(crate) align: bool,
    /// Add the splats of the scene that the edited file lacks, as when only a selection was saved
    #[arg(long)]
    pub(crate) keep_rest: bool,
    /// Only look: count what the edit kept, changed, added and removed, and show it in a picture of
    /// the frame before and after
    #[arg(long)]
    pub(crate) dry_run: bool,
    #[command(flatten)]
    pub(crate) common: SceneFlags,
    #[command(flatten)]
    pub(crate) refine: RefineFlags,
}

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
    /// Images to draw (view and time) [default: 240]
    #[arg(long, value_name = "N")]
    pub(crate) samples: Option<usize>,
    /// Coverage of the artifact mask, 0.5 (broad) to 2
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) epsilon: Option<f32>,
    /// How frame 1 is carried to other frames [default: backward; paper with --preset paper]
    #[arg(long, value_enum)]
    pub(crate) warp: Option<WarpArg>,
    /// Memory for images, MiB, 16 or more [default: 2048, or half of what is free]
    #[arg(long, value_name = "MIB")]
    pub(crate) memory: Option<usize>,
    /// Write a preview image into the run every so many seconds
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub(crate) preview_every: Option<f64>,
    /// Save a checkpoint for --resume every so many seconds
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
    /// The run folder; its colours are replaced, its motion and the edit as given stay
    pub(crate) run: PathBuf,
    /// `best` is what measured best, `paper` the paper to the letter [default: best]
    #[arg(long, value_enum)]
    pub(crate) preset: Option<PresetArg>,
    /// Options from the section `refine` of a TOML file, such as the c4d.toml of a run; flags win
    /// over it, it over the preset
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Go on from the checkpoint of an interrupted refinement with the same flags
    #[arg(long)]
    pub(crate) resume: bool,
    #[command(flatten)]
    pub(crate) bars: Bars,
    #[command(flatten)]
    pub(crate) rendering: Rendering,
    #[command(flatten)]
    pub(crate) flags: RefineFlags,
}

/// Forms of Eq. 13.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
pub(crate) enum WarpArg {
    /// Fetched through flow at the pixels of frame t, with occlusion test
    Backward,
    /// As printed
    Paper,
}

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
    /// Runs only: on the left what the run was made from, or with =unrefined the run without its
    /// refinement
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
    #[command(flatten)]
    pub(crate) common: SceneFlags,
}

#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Folder to write
    #[arg(short, long, default_value = "c4d-demo")]
    pub(crate) output: PathBuf,
    /// Seed of scene and edit
    #[arg(long, default_value_t = 7)]
    pub(crate) seed: u64,
    /// Number of splats of the source scene
    #[arg(long, default_value_t = 30_000)]
    pub(crate) splats: usize,
    /// Frames of the videos
    #[arg(long, default_value_t = 60)]
    pub(crate) frames: usize,
    #[command(flatten)]
    pub(crate) common: OutputFlags,
}

/// Left half of `c4d render --side-by-side`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LeftHalf {
    /// The scene before the edit
    Original,
    /// The edited scene before its refinement
    Unrefined,
}

/// Part of an image, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Crop {
    pub(crate) size: (u32, u32),
    /// Column and row of the first pixel.
    pub(crate) origin: [u32; 2],
}

/// Presets of the motion stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
pub(crate) enum PresetArg {
    /// What measured best
    Best,
    /// The paper to the letter
    Paper,
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
    /// Edited ones; the others keep theirs exactly
    Amg,
    /// All
    AmgAll,
}

/// What an edit belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FollowArg {
    /// The splats of the edited frame
    Splats,
    /// The surface that they show
    Surface,
}

impl FollowArg {
    /// As records have it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Splats => "splats",
            Self::Surface => "surface",
        }
    }
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
    /// Colour uncertainty since the edited frame (Eq. 16): of view dependence, and of what frame 1
    /// hid
    Uncertainty,
    /// The part of it that what frame 1 hid contributes
    Evidence,
    /// Artifact mask (Eq. 17)
    Mask,
}

impl Pass {
    /// Whether the pass compares a frame with the edited one.
    pub(crate) fn is_relative(self) -> bool {
        matches!(self, Self::Flow | Self::Uncertainty | Self::Evidence | Self::Mask)
    }

    /// Whether it takes what frame 1 does not supervise.
    pub(crate) fn needs_evidence(self) -> bool {
        matches!(self, Self::Uncertainty | Self::Evidence | Self::Mask)
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
        }
    }
}

/// Formats of renders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
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

fn parse_crop(text: &str) -> Result<Crop, String> {
    let parse = || {
        let mut parts = text.split('+');
        let size = parse_size(parts.next()?).ok()?;
        let mut side = || parts.next()?.trim().parse().ok().filter(|side| *side <= 16_384);
        let origin = [side()?, side()?];
        parts.next().is_none().then_some(Crop { size, origin })
    };
    parse().ok_or_else(|| "expected WxH+X+Y in pixels, as 240x240+250+180".to_owned())
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |part: &str| {
        part.trim().parse::<u32>().ok().filter(|&pixels| (1..=16_384).contains(&pixels))
    };
    text.split_once(['x', 'X', '×'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| {
            format!(
                "invalid image size `{text}`: expected WIDTHxHEIGHT, 1 to 16384 \
                               pixels each, for example 960x720"
            )
        })
}

fn parse_background(text: &str) -> Result<[f32; 3], String> {
    match text {
        "black" => return Ok([0.0; 3]),
        "white" => return Ok([1.0; 3]),
        _ => {}
    }
    let channels: Vec<f32> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    <[f32; 3]>::try_from(channels)
        .ok()
        .filter(|rgb| rgb.iter().all(|channel| (0.0..=1.0).contains(channel)))
        .ok_or_else(|| {
            format!(
                "invalid colour `{text}`: expected black, white or R,G,B with values from 0 to 1"
            )
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn sizes_and_colours() {
        assert_eq!(parse_size("640x480"), Ok((640, 480)), "plain");
        assert!(parse_size("0x480").is_err() && parse_size("640").is_err(), "nonsense");
        assert_eq!(parse_background("1,0.5,0"), Ok([1.0, 0.5, 0.0]), "triple");
        assert!(parse_background("1,2,3").is_err(), "out of range");
    }
}
