//! Flags of `c4d info` and `c4d doctor`.

use super::{AxesArg, ModelFlags, Rendering};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// A scene folder, a run, or a splat file
    pub(crate) path: PathBuf,
    /// Axes of an SPZ or glTF frame [default: those stated in the file, else those of its format]
    #[arg(long, visible_alias = "spz-axes", value_enum)]
    pub(crate) axes: Option<AxesArg>,
    #[command(flatten)]
    pub(crate) model: ModelFlags,
}

#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    #[command(flatten)]
    pub(crate) rendering: Rendering,
}
