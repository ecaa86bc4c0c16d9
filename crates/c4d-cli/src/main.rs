//! `c4d`: propagates an edit of one frame of a dynamic Gaussian-splat scene to all other times.
//!
//! Contains commands, progress, run folders and messages. Deliberately
//! absent: algorithms, which are in the other crates.

mod animated_image;
mod args;
mod camera_rig;
mod cameras;
mod caption;
mod commands;
mod console;
mod device;
mod edited_axes;
mod evaluation;
mod evidence;
mod failure;
mod field;
mod frames;
mod images;
mod lifetimes;
mod memory;
mod model_flags;
mod output;
mod overlays;
mod passes;
mod placement;
mod progress;
mod rates;
mod renderer;
mod report;
mod rigid_parts;
mod run_folder;
mod scene;
mod settings;
mod stages;
mod still;
mod suggestion;
mod video;

use args::{BenchCommand, Cli, Command, Global};
use clap::Parser;
use console::Console;
use failure::{Exit, Failure, Outcome};
use std::process::ExitCode;

/// Largest accepted number of threads; more are assumed to be a typing error.
const MAX_THREADS: usize = 1024;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let global = &cli.global();
    device::without_desktop(global.gpu);
    let console = Console::new(global.quiet, global.verbose, !global.no_progress);
    // Best effort: without a handler an interrupt still ends the process, but may leave a hidden
    // partial output.
    let _ = ctrlc::set_handler(|| {
        gs_io::remove_unfinished();
        if commands::view::is_serving() {
            std::process::exit(0);
        }
        eprintln!("\ninterrupted; no partial output remains");
        std::process::exit(i32::from(Exit::Interrupted as u8));
    });
    match run(&cli, global, &console) {
        Ok(()) if global.strict && console.warnings() > 0 => {
            eprintln!("finished with {} warnings (--strict)", console.warnings());
            ExitCode::from(Exit::Warnings as u8)
        }
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::from(failure.exit as u8)
        }
    }
}

fn run(cli: &Cli, global: &Global, console: &Console) -> Outcome {
    let threads = global.threads;
    if let Some(threads) = threads.filter(|threads| !(1..=MAX_THREADS).contains(threads)) {
        return Err(Failure::usage(format!("--threads {threads}: expected 1 to {MAX_THREADS}")));
    }
    // Started here, where a failure is an error; at first use it would be a panic.
    rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build_global().map_err(
        |error| {
            Failure::failed(format!("cannot start the threads: {error}"))
                .next("Give a smaller --threads, or allow the process more memory.")
        },
    )?;
    if cfg!(debug_assertions) {
        console
            .detail("this is a debug build: expect it to be about ten times slower than --release");
    }
    match &cli.command {
        Command::Info(args) => commands::info::run(args, global, console),
        Command::Doctor(args) => commands::doctor::run(args, global, console),
        Command::Freeze(args) => commands::freeze::run(args, global, console),
        Command::Edit(args) => commands::edit::run(args, global, console),
        Command::Propagate(args) => commands::propagate::run(args, global, console),
        Command::Refine(args) => commands::refine::run(args, global, console),
        Command::Render(args) => commands::render::run(args, global, console),
        Command::Export(args) => commands::export::run(args, global, console),
        Command::Eval(args) => commands::eval::run(args, global, console),
        Command::Compare(args) => commands::compare::run(args, global, console),
        Command::View(args) => commands::view::run(args, global, console),
        Command::Demo(args) => commands::demo::run(args, global, console),
        Command::Bench { what: BenchCommand::Motion(args) } => {
            commands::bench::motion(args, global, console)
        }
        Command::Completions(args) => commands::shell::completions(args),
        Command::Man(args) => commands::shell::manual(args, global, console),
    }
}
