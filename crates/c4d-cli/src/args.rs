//! The command line.

mod bench;
mod compare;
mod demo;
mod edit;
mod eval;
mod export;
mod export_format;
mod freeze;
mod gather;
mod inspect;
mod overlay;
mod preset;
mod propagate;
mod refine;
mod render;
mod shared;
mod shell;
mod values;
mod view;
mod views;

pub(crate) use bench::{BenchCommand, BenchMotionArgs, BenchSuiteArgs};
pub(crate) use compare::CompareArgs;
pub(crate) use demo::DemoArgs;
pub(crate) use edit::EditArgs;
pub(crate) use eval::{EvalArgs, JudgeArg, MeasureFlags};
pub(crate) use export::ExportArgs;
pub(crate) use export_format::ExportFormat;
pub(crate) use freeze::FreezeArgs;
pub(crate) use gather::GatherArgs;
pub(crate) use inspect::{DoctorArgs, InfoArgs};
pub(crate) use overlay::OverlayArg;
pub(crate) use preset::PresetArg;
pub(crate) use propagate::{BaselineArg, FollowArg, MotionArg, PropagateArgs};
pub(crate) use refine::{RefineArgs, RefineFlags, WarpArg};
pub(crate) use render::{Format, LeftHalf, Pass, RenderArgs};
pub(crate) use shared::{
    Common, Global, ModelFlags, OutputFlags, Overwriting, Rendering, SceneFlags,
};
pub(crate) use shell::{CompletionsArgs, ManArgs};
pub(crate) use values::Crop;
pub(crate) use view::ViewArgs;
pub(crate) use views::{AxesArg, CamerasAs, SplitArg, Up};

use crate::failure::{Failure, Outcome};
use clap::{Parser, Subcommand};
use std::ffi::OsString;

const AFTER_HELP: &str = "\
Exit codes: 0 done, 1 failed, 2 usage, 3 bad input file, 4 no such GPU, 6 finished with warnings under --strict, 130 interrupted.

SCENE is a trained scene (4DGaussians, Swift4D, Deformable-3D-Gaussians, SC-GS, Grid4D, DASH, E-D3DGS, native 4D Gaussians, FreeTimeGS, Spacetime Gaussians, Dynamic 3D Gaussians), a folder or zip archive of numbered PLYs with persistent rows, a .splatv, .splat4d, .4dgs or .tsog clip, or a RUN folder of `c4d propagate`.";

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
    /// Parses the arguments after the program's name.
    pub(crate) fn of(arguments: &[OsString]) -> Outcome<Self> {
        let words = std::iter::once(OsString::from("c4d")).chain(arguments.iter().cloned());
        Self::try_parse_from(words).map_err(|error| {
            let text = error.render().to_string();
            let text = text.trim_end();
            Failure::usage(text.strip_prefix("error: ").unwrap_or(text))
        })
    }

    /// The shared flags of the command.
    pub(crate) fn global(&self) -> Global {
        let global = Global::of(&self.common);
        match &self.command {
            Command::Info(args) => global.model(&args.model),
            Command::Doctor(args) => global.rendering(&args.rendering),
            Command::Freeze(args) => global.scene(&args.common),
            Command::Edit(args) => global.scene(&args.common),
            Command::Propagate(args) => global.scene(&args.common),
            Command::Refine(args) => global.output(&args.common),
            Command::Render(args) => global.scene(&args.common),
            Command::Export(args) => global.scene(&args.common),
            Command::Eval(args) => global.scene(&args.common),
            Command::Compare(args) => global.output(&args.common),
            Command::Gather(args) => global.output(&args.common),
            Command::View(args) => global.scene(&args.common),
            Command::Demo(args) => global.output(&args.common),
            Command::Bench { what: BenchCommand::Motion(args) } => {
                global.writes(&args.writes).bars(&args.bars)
            }
            Command::Bench { what: BenchCommand::Suite(args) } => {
                global.writes(&args.writes).bars(&args.bars)
            }
            Command::Completions(_) => global,
            Command::Man(args) => global.writes(&args.writes),
        }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show the kind of a file or folder, what is missing, and the next step
    Info(InfoArgs),
    /// Check whether this machine can run c4d, and how fast
    Doctor(DoctorArgs),
    /// Write the splats of one time as a PLY for any 3D editor, with cameras
    Freeze(FreezeArgs),
    /// Edit a frame by selections and actions, or fit it to edited pictures
    Edit(EditArgs),
    /// Propagate an edited frame to all times
    Propagate(PropagateArgs),
    /// Repair colours that motion reveals in a run (part of c4d propagate)
    Refine(RefineArgs),
    /// Render images or a video
    Render(RenderArgs),
    /// Write frames and clips for other tools, or a page that plays in any browser
    Export(ExportArgs),
    /// Measure a run: appearance, motion, and error against ground truth
    Eval(EvalArgs),
    /// Compare runs in one page: pictures, curves, numbers, and where they differ most
    Compare(CompareArgs),
    /// Join parts that render, eval or refine wrote with --part
    Gather(GatherArgs),
    /// Show scenes and runs in the browser: compare, inspect splats, select, save cameras
    View(ViewArgs),
    /// Generate a synthetic scene, edit it, propagate the edit and render both
    Demo(DemoArgs),
    /// Compare methods against ground truth, or on your own scenes and edits
    Bench {
        #[command(subcommand)]
        what: BenchCommand,
    },
    /// Print completions for a shell
    Completions(CompletionsArgs),
    /// Write manual pages, one per command
    Man(ManArgs),
}

impl Command {
    /// The name on the command line.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Info(_) => "info",
            Self::Doctor(_) => "doctor",
            Self::Freeze(_) => "freeze",
            Self::Edit(_) => "edit",
            Self::Propagate(_) => "propagate",
            Self::Refine(_) => "refine",
            Self::Render(_) => "render",
            Self::Export(_) => "export",
            Self::Eval(_) => "eval",
            Self::Compare(_) => "compare",
            Self::Gather(_) => "gather",
            Self::View(_) => "view",
            Self::Demo(_) => "demo",
            Self::Bench { what: BenchCommand::Motion(_) } => "bench motion",
            Self::Bench { what: BenchCommand::Suite(_) } => "bench suite",
            Self::Completions(_) => "completions",
            Self::Man(_) => "man",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
