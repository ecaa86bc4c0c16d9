//! `c4d edit`: edits a frame by selections and actions, or fits it to edited pictures.

mod checkpoint;
mod operations;
mod picture;
mod picture_files;
mod pictures;
mod progress;
mod record;
mod resources;
mod style;

use crate::args::{EditArgs, Global};
use crate::console::Console;
use crate::failure::{Failure, Outcome};

pub(crate) fn run(args: &EditArgs, global: &Global, console: &Console) -> Outcome {
    let Some(views) = &args.pictures.views else {
        return operations::run(args, global, console);
    };
    if let Some((name, _)) = args.operations.options.first() {
        return Err(Failure::usage(format!("--{name} and --views exclude each other"))
            .next("Run c4d edit twice, with the result of the first as the input of the second."));
    }
    pictures::run(args, views, global, console)
}
