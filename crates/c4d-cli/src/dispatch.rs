//! [`run`]: the command of a parsed command line.

use crate::args::{BenchCommand, Cli, Command, Global};
use crate::commands;
use crate::console::Console;
use crate::failure::{Exit, Failure, Outcome};
use crate::threads::start_threads;

/// Starts the threads and runs the command. Usage errors without a next step refer to its help.
pub(crate) fn run(cli: &Cli, global: &Global, console: &Console) -> Outcome {
    run_command(cli, global, console).map_err(|failure| match (failure.exit, &failure.next) {
        (Exit::Usage, None) => {
            let command = cli.command.name();
            failure.next(format!("c4d {command} --help lists the flags and their values."))
        }
        _ => failure,
    })
}

fn run_command(cli: &Cli, global: &Global, console: &Console) -> Outcome {
    start_threads(global.threads)?;
    if cfg!(debug_assertions) {
        console
            .detail("this is a debug build: expect it to be about ten times slower than --release");
    }
    if global.json
        && matches!(cli.command, Command::View(_) | Command::Completions(_) | Command::Man(_))
    {
        return Err(Failure::usage("--json is for commands that report results"));
    }
    match &cli.command {
        Command::Info(args) => commands::info::run(args, global, console),
        Command::Doctor(_) => commands::doctor::run(global, console),
        Command::Freeze(args) => commands::freeze::run(args, global, console),
        Command::Edit(args) => commands::edit::run(args, global, console),
        Command::Propagate(args) => commands::propagate::run(args, global, console),
        Command::Refine(args) => commands::refine::run(args, global, console),
        Command::Render(args) => commands::render::run(args, global, console),
        Command::Export(args) => commands::export::run(args, global, console),
        Command::Eval(args) => commands::eval::run(args, global, console),
        Command::Compare(args) => commands::compare::run(args, global, console),
        Command::Gather(args) => commands::gather::run(args, global, console),
        Command::View(args) => commands::view::run(args, global, console),
        Command::Demo(args) => commands::demo::run(args, global, console),
        Command::Bench { what: BenchCommand::Motion(args) } => {
            commands::bench::motion(args, global, console)
        }
        Command::Bench { what: BenchCommand::Suite(args) } => {
            commands::bench::suite(args, global, console)
        }
        Command::Completions(args) => commands::shell::completions(args),
        Command::Man(args) => commands::shell::manual(args, global, console),
    }
}
