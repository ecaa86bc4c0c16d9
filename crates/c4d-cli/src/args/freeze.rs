//! Arguments of `c4d freeze`.

use super::{SceneFlags, Up};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct FreezeArgs {
    /// The dynamic scene
    pub(crate) scene: PathBuf,
    /// Time of the frame to edit
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) time: f32,
    /// Folder to write `point_cloud.ply`, `cameras.json` and `views/` into
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Cameras to write next to the PLY, as `c4d render --cameras` [default: a rig around the scene]
    #[arg(long, value_name = "PATH")]
    pub(crate) cameras: Option<PathBuf>,
    /// Render this many views into `views/`, to be edited as pictures for `c4d edit --views`;
    /// `cameras.json` then contains their cameras [default: no pictures]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) views: Option<u16>,
    /// Size of the pictures [default: that of the scene's own cameras, 512x512 for the rig]
    #[arg(long, value_name = "WxH", value_parser = super::values::parse_size, requires = "views")]
    pub(crate) size: Option<(u32, u32)>,
    /// Keep SH only up to this degree
    #[arg(long, value_name = "0-3")]
    pub(crate) sh_degree: Option<usize>,
    /// Omit splats that are invisible at that time; `c4d propagate` adds them again
    #[arg(long)]
    pub(crate) visible: bool,
    /// The world's upward direction, for the rig
    #[arg(long, value_enum, allow_hyphen_values = true)]
    pub(crate) up: Option<Up>,
    #[command(flatten)]
    pub(crate) common: SceneFlags,
}
