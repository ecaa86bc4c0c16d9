//! Chores that cargo cannot express. `cargo xtask --help` lists them.

mod doc_commands;
mod fixtures;
mod tidy;

use clap::{Parser, Subcommand};
use std::path::{Path, PathBuf};

#[derive(Debug, Parser)]
#[command(name = "xtask", about = "Chores of the workspace")]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Write the generated fixtures anew (reference goldens are not generated here and stay as they are)
    RegenerateFixtures {
        /// Compare only; fail when a fixture differs from what would be written
        #[arg(long)]
        check: bool,
    },
    /// Check crate layering, file sizes, equation numbers, paths and documentation
    Tidy,
    /// Run every command of the `sh` blocks in README.md and docs/, in order, in a fresh folder
    DocCommands,
}

fn main() -> anyhow::Result<()> {
    match Cli::parse().task {
        Task::RegenerateFixtures { check } => fixtures::regenerate(check),
        Task::Tidy => tidy::run(),
        Task::DocCommands => doc_commands::run(),
    }
}

/// Top of the workspace.
fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .map_or_else(|| PathBuf::from("."), Path::to_owned)
}
