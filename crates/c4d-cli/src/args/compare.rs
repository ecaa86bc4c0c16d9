//! Arguments of `c4d compare`.

use super::{MeasureFlags, OutputFlags};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// The runs, 1 to 6
    #[arg(required = true, num_args = 1..=6)]
    pub(crate) runs: Vec<PathBuf>,
    /// HTML file to write
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Read the numbers from these files of `c4d eval -o`, one per run in the same order, instead of
    /// measuring
    #[arg(long, value_delimiter = ',', value_name = "METRICS.JSON,…")]
    pub(crate) numbers: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) measure: MeasureFlags,
    #[command(flatten)]
    pub(crate) common: OutputFlags,
}
