//! Arguments of `c4d bench`.

use super::shared::{Bars, Overwriting};
use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// End-point error, rotation, jitter and rendered PSNR of every motion method on synthetic
    /// scenes
    Motion(BenchMotionArgs),
}

#[derive(Debug, Args)]
pub(crate) struct BenchMotionArgs {
    /// Cases [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAME,…")]
    pub(crate) cases: Vec<String>,
    /// Scenes per case
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) seeds: u64,
    /// Splats of each source scene
    #[arg(long, default_value_t = 5000)]
    pub(crate) size: usize,
    /// Leaves out what needs a deformation network trained on every scene (seconds each)
    #[arg(long)]
    pub(crate) no_network: bool,
    /// Folder for motion.json and motion.md
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) writes: Overwriting,
    #[command(flatten)]
    pub(crate) bars: Bars,
}
