//! Arguments of `c4d demo`.

use super::OutputFlags;
use clap::Args;
use std::path::PathBuf;

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
