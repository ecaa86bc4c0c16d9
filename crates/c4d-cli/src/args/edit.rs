//! Flags of `c4d edit`.

mod operations;

use operations::OperationFlags;

use crate::failure::{Failure, Outcome};

use super::{AxesArg, SceneFlags, Up};
use clap::Args;
use std::path::PathBuf;

/// Shown below the flags.
const AFTER_HELP: &str = "\
EXPR, with `&`, `|`, `!`, `( )`; lengths are world units:
  all                        box x,y,z,X,Y,Z        sphere x,y,z,R         plane nx,ny,nz,d (n·x ≥ d)
  opacity<.2   size>.1       x, y, z, red, green, blue, saturation, brightness: <  <=  >  >=  or a..b
  color #e33~.15             hue 200..260           moving                 part N
  mask DIR                   ids FILE               connected x,y,z [gap D] [of EXPR]
  near D EXPR                grow D EXPR            shrink D EXPR

Selections and actions are applied in the given order. Example:
  c4d edit SCENE --select 'hue 200..260 & moving' --hue 120 --select 'part 2' --scale 1.2 -o edited.ply --preview look.png";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct EditArgs {
    /// What to edit: one frame in any format (as c4d propagate --edited), the folder of
    /// `c4d freeze`, or a scene, at --time
    #[arg(value_name = "SCENE|FRAME")]
    pub(crate) input: PathBuf,
    /// The edited frame, a 3DGS PLY; NAME.edit.json next to it records the steps
    #[arg(short, long, value_name = "EDITED.ply")]
    pub(crate) output: Option<PathBuf>,
    /// Time of the scene to edit [default: that of a replayed edit, else the first]
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) time: Option<f32>,
    #[command(flatten)]
    pub(crate) operations: OperationFlags,
    /// Write a picture: before, selection, after
    #[arg(long, value_name = "PNG")]
    pub(crate) preview: Option<PathBuf>,
    /// Print the number, position, size and colour of the splats in each selection
    #[arg(long)]
    pub(crate) stats: bool,
    /// Axes of an SPZ or glTF frame [default: those stated in the file, else those of its format]
    #[arg(long, visible_alias = "spz-axes", value_enum)]
    pub(crate) axes: Option<AxesArg>,
    /// The world's upward direction, for the picture
    #[arg(long, value_enum, allow_hyphen_values = true)]
    pub(crate) up: Option<Up>,
    #[command(flatten)]
    pub(crate) common: SceneFlags,
    #[command(flatten)]
    pub(crate) pictures: PictureFlags,
}

impl EditArgs {
    /// The output, which a fit to pictures must have.
    pub(crate) fn fitted_output(&self) -> Outcome<&PathBuf> {
        let missing = || Failure::usage("--views without -o").next("Add -o EDITED.ply.");
        self.output.as_ref().ok_or_else(missing)
    }
}

/// Flags of the fit to edited pictures.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Edited pictures")]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct PictureFlags {
    /// Folder with the edited pictures of `c4d freeze --views`: PNG or JPEG, names and sizes
    /// unchanged
    #[arg(long, value_name = "DIR")]
    pub(crate) views: Option<PathBuf>,
    /// Cameras of the pictures [default: `cameras.json` in the folder of the pictures, else in that
    /// of the frame]
    #[arg(long, value_name = "FILE", requires = "views")]
    pub(crate) cameras: Option<PathBuf>,
    /// Edited pixels: `auto` (those that differ from the scene), or a folder with a mask for each
    /// picture (white: edited)
    #[arg(long, value_name = "DIR|auto", default_value = "auto", requires = "views")]
    pub(crate) mask: PathBuf,
    /// Steps of the fit, one picture each
    #[arg(long, value_name = "N", default_value_t = 800, requires = "views",
        value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) steps: u32,
    /// Change colours and opacities only
    #[arg(long, requires = "views")]
    pub(crate) keep_geometry: bool,
    /// Do not add or remove splats, except for removing faint ones
    #[arg(long, requires = "views")]
    pub(crate) no_densify: bool,
    /// Picture whose colours and positions are used where the pictures disagree [default: their
    /// mean]
    #[arg(long, value_name = "VIEW", requires = "views")]
    pub(crate) reference: Option<String>,
    /// Do not align the pictures with each other
    #[arg(long, requires = "views")]
    pub(crate) no_align: bool,
    /// Random seed
    #[arg(long, default_value_t = 0, requires = "views")]
    pub(crate) seed: u64,
    /// Interval between checkpoints for --resume
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 20.0,
        requires = "views",
        allow_negative_numbers = true
    )]
    pub(crate) checkpoint_every: f64,
    /// Continue an interrupted fit of the same output; inputs and flags must be the same
    #[arg(long, requires = "views")]
    pub(crate) resume: bool,
}
