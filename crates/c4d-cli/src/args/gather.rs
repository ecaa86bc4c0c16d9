//! Arguments of `c4d gather`.

use super::OutputFlags;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct GatherArgs {
    /// All parts of one command, in any order: folders of `c4d render --part` or `c4d refine
    /// --part`, or files of `c4d eval --part`
    #[arg(required = true, value_name = "PART")]
    pub(crate) parts: Vec<PathBuf>,
    /// Output of the whole command: for render a folder, a video (.mp4, .webp, .gif) or a sheet
    /// (.png); for eval a JSON file; for refine the run, which is then refined
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) common: OutputFlags,
}
