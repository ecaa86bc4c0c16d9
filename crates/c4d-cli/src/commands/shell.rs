//! `c4d completions` and `c4d man`: completions for shells and manual pages, generated from the
//! definition of the command line.

use crate::args::{Cli, CompletionsArgs, Global, ManArgs};
use crate::console::Console;
use crate::failure::{Failure, Outcome, ROOM};
use crate::output::{existing, output_failure};
use clap::CommandFactory;
use clap_mangen::Man;
use gs_io::AtomicDir;
use std::fs;
use std::io::{ErrorKind, Write};

/// Prints the completions of a shell.
pub(crate) fn completions(args: &CompletionsArgs) -> Outcome {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "c4d", &mut script);
    match std::io::stdout().lock().write_all(&script) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::failed(format!("standard output: {error}")).next(ROOM))
        }
        _ => Ok(()),
    }
}

/// Writes the manual pages of the program and of each command.
pub(crate) fn manual(args: &ManArgs, global: &Global, console: &Console) -> Outcome {
    let folder = AtomicDir::create(&args.output, existing(global))
        .map_err(|error| output_failure(&error))?;
    let section = folder.path().join("man1");
    let failed = |error: std::io::Error| Failure::failed(format!("manual pages: {error}"));
    fs::create_dir(&section).map_err(failed)?;
    let mut root = Cli::command();
    root.build();
    let mut pages = vec![root.clone()];
    while let Some(command) = pages.pop() {
        let subcommands = command.get_subcommands().filter(|command| command.get_name() != "help");
        pages.extend(subcommands.cloned());
        let name = command.get_display_name().unwrap_or("c4d").to_owned();
        let mut page = Vec::new();
        Man::new(command.disable_help_subcommand(true)).render(&mut page).map_err(failed)?;
        fs::write(section.join(format!("{name}.1")), page).map_err(failed)?;
    }
    folder.commit().map_err(|error| output_failure(&error))?;
    console
        .note(format!("wrote {0}; `man -M {0} c4d` shows the first page", args.output.display()));
    Ok(())
}
