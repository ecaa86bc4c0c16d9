//! Maintenance tasks that cargo cannot express. `cargo xtask --help` lists them.

mod build_times;
mod doc_commands;
mod expected_output;
mod fixtures;
mod interop;
mod robots;
mod sensitivity;
mod stability;
mod test_times;
mod tidy;
mod truth_scenes;
mod workspace;

use clap::{Parser, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Parser)]
#[command(name = "xtask", about = "Maintenance tasks of the workspace")]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Regenerate the generated fixtures (reference goldens are
    /// not generated here and stay unchanged)
    RegenerateFixtures {
        /// Compare only; fail when a fixture differs from what would be written
        #[arg(long)]
        check: bool,
    },
    /// Check crate layering, file sizes, equation numbers, paths and documentation
    Tidy,
    /// Run the `sh` blocks of README.md and of most documents in docs/, in order, in a new folder
    DocCommands,
    /// Write docs/TESTS.md, the test suite with its times; without a log, compare its rows with the
    /// test files
    TestTimes {
        /// Output of `cargo test --release --workspace`, both streams
        log: Option<PathBuf>,
    },
    /// Print what each package costs in a clean build
    BuildTimes {
        /// The report of `cargo build --timings` (`target/cargo-timings/cargo-timing.html`)
        report: PathBuf,
    },
    /// Convert frames with other tools both ways and write docs/INTEROP.md (needs node, Python and
    /// their registries)
    Interop {
        /// Use this `c4d` instead of building one
        #[arg(long)]
        program: Option<PathBuf>,
    },
    /// Draw how the paper's weights change its results, and print the numbers
    Stability,
    /// Draw how the parameters of the default motion model change its error, and print a table
    Sensitivity {
        /// Source splats of each scene
        #[arg(long, default_value_t = 800)]
        size: usize,
        /// Seeds, each with ten cases of `gs-synth` and four robots
        #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
        seeds: u64,
    },
    /// Write a scene with known motion: source, a deformation network trained on it, edit, truth
    /// with its video, cameras
    TruthScene {
        /// Case, as in `c4d bench motion`
        #[arg(long, default_value = "clothing")]
        case: String,
        /// Random seed
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// Source splats
        #[arg(long, default_value_t = 5000)]
        size: usize,
        /// New folder
        #[arg(short, long)]
        output: PathBuf,
    },
}

fn main() -> anyhow::Result<()> {
    match Cli::parse().task {
        Task::RegenerateFixtures { check } => fixtures::regenerate(check),
        Task::Tidy => tidy::run(),
        Task::DocCommands => doc_commands::run(),
        Task::TestTimes { log: Some(log) } => test_times::write(&log),
        Task::TestTimes { log: None } => test_times::check(),
        Task::BuildTimes { report } => build_times::print(&report),
        Task::Interop { program } => interop::run(program),
        Task::Stability => stability::run(),
        Task::Sensitivity { size, seeds } => sensitivity::run(size, seeds),
        Task::TruthScene { case, seed, size, output } => {
            truth_scenes::write(&case, seed, size, &output)
        }
    }
}
