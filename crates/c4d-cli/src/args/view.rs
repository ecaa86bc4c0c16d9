//! Arguments of `c4d view`.

use super::{OverlayArg, SceneFlags, Up};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct ViewArgs {
    /// Scenes, runs or frames, up to four; a single run is shown with its source
    #[arg(required = true, num_args = 1..=4, value_name = "SCENE")]
    pub(crate) scenes: Vec<PathBuf>,
    /// Reload a scene when its files change; wait for scenes that do not exist yet
    #[arg(long)]
    pub(crate) watch: bool,
    /// Port on 127.0.0.1 [default: a free one]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(crate) port: u16,
    /// Only print the address, without opening a browser
    #[arg(long)]
    pub(crate) no_open: bool,
    /// File for the cameras saved in the page, which `c4d render --cameras` reads
    #[arg(long, value_name = "FILE", default_value = "view_cameras.json")]
    pub(crate) save_cameras: PathBuf,
    /// Number of frames, evenly spaced over the whole clip [default: that of the first scene, else
    /// 60]
    #[arg(long)]
    pub(crate) frames: Option<usize>,
    /// Frames per second [default: the rate at which the frames last as long as the clip]
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) fps: Option<f64>,
    /// SH degree to show, at most that of the scenes [default: 1]
    #[arg(long, value_name = "0-3")]
    pub(crate) sh_degree: Option<usize>,
    /// Overlays to offer [default: all that apply, except uncertainty, which takes the longest]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAME,…")]
    pub(crate) overlay: Vec<OverlayArg>,
    /// The world's upward direction [default: that of the first scene]
    #[arg(long, value_enum, allow_hyphen_values = true)]
    pub(crate) up: Option<Up>,
    #[command(flatten)]
    pub(crate) common: SceneFlags,
}
