//! Arguments of `c4d edit`.

use super::{Bars, Overwriting, Rendering};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct EditArgs {
    /// The frame: a folder of `c4d freeze`, or a splat file
    #[arg(value_name = "FRAME")]
    pub(crate) input: PathBuf,
    /// 3DGS PLY to write
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Picture to write of what was edited
    #[arg(long, value_name = "PNG")]
    pub(crate) preview: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) pictures: PictureFlags,
    #[command(flatten)]
    pub(crate) writes: Overwriting,
    #[command(flatten)]
    pub(crate) bars: Bars,
    #[command(flatten)]
    pub(crate) rendering: Rendering,
}

/// Flags of the fit to edited pictures.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Edited pictures")]
pub(crate) struct PictureFlags {
    /// Folder with the edited pictures of `c4d freeze --views`: PNG or JPEG, names and sizes as they were
    #[arg(long, value_name = "DIR")]
    pub(crate) views: Option<PathBuf>,
    /// Cameras of the pictures [default: `cameras.json` in the folder of the pictures, else in that of the frame]
    #[arg(long, value_name = "FILE", requires = "views")]
    pub(crate) cameras: Option<PathBuf>,
    /// Where the pictures count: `auto`, where they differ from the scene, or a folder with a mask for each picture (white: edited)
    #[arg(long, value_name = "DIR|auto", default_value = "auto", requires = "views")]
    pub(crate) mask: PathBuf,
    /// Steps of the fit, one picture each
    #[arg(long, value_name = "N", default_value_t = 800, requires = "views",
        value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) steps: u32,
    /// Change colours and opacities only
    #[arg(long, requires = "views")]
    pub(crate) keep_geometry: bool,
    /// Add and remove no splats, except faint ones
    #[arg(long, requires = "views")]
    pub(crate) no_densify: bool,
    /// The picture whose colours and position hold where the pictures disagree [default: their mean]
    #[arg(long, value_name = "VIEW", requires = "views")]
    pub(crate) reference: Option<String>,
    /// Take the pictures as they are: do not align them with each other
    #[arg(long, requires = "views")]
    pub(crate) no_align: bool,
    /// Seed of everything random
    #[arg(long, default_value_t = 0, requires = "views")]
    pub(crate) seed: u64,
    /// Go on with an interrupted fit of the same output with the same inputs and flags
    #[arg(long, requires = "views")]
    pub(crate) resume: bool,
}
