//! Flags shared by several commands. Each command lists those that it
//! uses in its help, and refuses the others.

use crate::device::GpuChoice;
use clap::Args;

/// Flags of every command.
#[derive(Debug, Clone, Default, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct Common {
    /// Print only warnings and errors
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Print more details
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
    /// Threads to use [default: all cores]
    #[arg(long, global = true, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Fail on damaged rows, and exit with code 6 after warnings
    #[arg(long, global = true)]
    pub(crate) strict: bool,
    /// Print the results as one JSON object
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

/// Flags of commands that write.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct Overwriting {
    /// Replace an existing file, or a folder that contains only output of c4d
    #[arg(short = 'w', long)]
    pub(crate) overwrite: bool,
}

/// Flags of long-running commands.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct Bars {
    /// No progress bars
    #[arg(long)]
    pub(crate) no_progress: bool,
}

/// Flags of commands that render.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct Rendering {
    /// Where to render: auto (a hardware GPU if there is one, else the CPU), cpu, or an adapter's
    /// number in `c4d doctor`
    #[arg(
        short,
        long,
        default_value = "auto",
        value_name = "auto|cpu|N",
        allow_negative_numbers = true
    )]
    pub(crate) gpu: GpuChoice,
}

/// Flags of commands that read a model folder.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Model folders")]
pub(crate) struct ModelFlags {
    /// Use this iteration instead of the newest
    #[arg(long, value_name = "N")]
    pub(crate) iteration: Option<u64>,
    /// Override a flag of `cfg_args`, or set one that is not stored in any file, for example
    /// `no_dshs=true`; 4DGS: no_dx, no_ds, no_dr, no_do, no_dshs, apply_rotation, grid_pe; Swift4D:
    /// activation, index_rule, dynamic_thro, frames, time_divisor, n_levels, n_features_per_level,
    /// hashmap_size, base_resolution; native 4D Gaussians: time_duration=START,END; Grid4D and
    /// DASH: bound; sequences of SPZ or glTF: axes (ply, rub, luf)
    #[arg(long = "set", value_name = "FLAG=VALUE")]
    pub(crate) set: Vec<String>,
}

/// Flags of long-running commands that render and write.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct OutputFlags {
    #[command(flatten)]
    pub(crate) writes: Overwriting,
    #[command(flatten)]
    pub(crate) bars: Bars,
    #[command(flatten)]
    pub(crate) rendering: Rendering,
}

/// Flags of long-running commands that read a scene, render and write.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct SceneFlags {
    #[command(flatten)]
    pub(crate) output: OutputFlags,
    #[command(flatten)]
    pub(crate) model: ModelFlags,
}

/// The shared flags of one call; flags that the command does not have are at their defaults.
#[derive(Debug, Clone, Default)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "flags of a command line are independent switches"
)]
pub(crate) struct Global {
    pub(crate) overwrite: bool,
    pub(crate) quiet: bool,
    pub(crate) verbose: bool,
    pub(crate) no_progress: bool,
    pub(crate) threads: Option<usize>,
    pub(crate) gpu: GpuChoice,
    pub(crate) strict: bool,
    pub(crate) json: bool,
    pub(crate) iteration: Option<u64>,
    pub(crate) set: Vec<String>,
}

impl Global {
    /// The flags of every command.
    pub(super) fn of(common: &Common) -> Self {
        let Common { quiet, verbose, threads, strict, json } = *common;
        Self { quiet, verbose, threads, strict, json, ..Self::default() }
    }

    pub(super) fn writes(self, flags: &Overwriting) -> Self {
        Self { overwrite: flags.overwrite, ..self }
    }

    pub(super) fn bars(self, flags: &Bars) -> Self {
        Self { no_progress: flags.no_progress, ..self }
    }

    pub(super) fn rendering(self, flags: &Rendering) -> Self {
        Self { gpu: flags.gpu, ..self }
    }

    pub(super) fn model(self, flags: &ModelFlags) -> Self {
        Self { iteration: flags.iteration, set: flags.set.clone(), ..self }
    }

    pub(super) fn output(self, flags: &OutputFlags) -> Self {
        self.writes(&flags.writes).bars(&flags.bars).rendering(&flags.rendering)
    }

    pub(super) fn scene(self, flags: &SceneFlags) -> Self {
        self.output(&flags.output).model(&flags.model)
    }
}
