//! Arguments of `c4d bench`.

use super::shared::{Bars, Overwriting};
use crate::part::Share;
use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// End-point error, rotation, jitter and rendered PSNR of every motion method on synthetic
    /// scenes
    Motion(BenchMotionArgs),
    /// Propagate and measure every edit of every scene with every method of a TOML file
    Suite(BenchSuiteArgs),
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
    /// Omit the methods that need a deformation network trained on each scene (seconds each)
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

#[derive(Debug, Args)]
pub(crate) struct BenchSuiteArgs {
    /// TOML file with scenes, their edits, and methods; docs/SCALING.md describes it
    pub(crate) suite: PathBuf,
    /// Folder for the runs, table.md and table.csv; runs that an earlier call completed are kept
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Compute only the K-th of N equal parts of the runs; a call without --part computes the
    /// missing runs and writes the tables
    #[arg(long, value_name = "K/N", value_parser = Share::parse)]
    pub(crate) part: Option<Share>,
    #[command(flatten)]
    pub(crate) writes: Overwriting,
    #[command(flatten)]
    pub(crate) bars: Bars,
}
