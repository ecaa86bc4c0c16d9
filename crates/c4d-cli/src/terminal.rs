//! [`main`]: the program, with its messages on the terminal.

use crate::args::Cli;
use crate::commands::view;
use crate::console::Console;
use crate::device;
use crate::dispatch::run;
use crate::failure::Exit;
use clap::Parser;
use std::process::ExitCode;

/// Runs the program `c4d` on the arguments of this process.
///
/// Exits by itself after `--help`, `--version` and invalid arguments, and when interrupted.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let global = &cli.global();
    device::without_desktop(global.gpu);
    let console = Console::new(global.quiet, global.verbose, !global.no_progress).json(global.json);
    // Best effort: without a handler an interrupt still ends the process, but may leave a hidden
    // partial output.
    let _ = ctrlc::set_handler(|| {
        gs_io::remove_unfinished();
        if view::is_serving() {
            std::process::exit(0);
        }
        eprintln!("\ninterrupted; no partial output remains");
        std::process::exit(i32::from(Exit::Interrupted as u8));
    });
    let failure = match run(&cli, global, &console) {
        Ok(()) if global.strict && console.warnings() > 0 => {
            let failure = console.strict_failure();
            eprintln!("{}", failure.what);
            Some(failure)
        }
        Ok(()) => None,
        Err(failure) => {
            eprintln!("error: {failure}");
            Some(failure)
        }
    };
    console.end(failure.as_ref());
    failure.map_or(ExitCode::SUCCESS, |failure| ExitCode::from(failure.exit as u8))
}
