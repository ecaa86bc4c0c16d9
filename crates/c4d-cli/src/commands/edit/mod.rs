//! `c4d edit`: make the edit here, from edited pictures.

mod checkpoint;
mod picture_files;
mod pictures;
mod watch;

use crate::args::{EditArgs, Global};
use crate::console::Console;
use crate::failure::{Failure, Outcome};

pub(crate) fn run(args: &EditArgs, global: &Global, console: &Console) -> Outcome {
    match &args.pictures.views {
        Some(views) => pictures::run(args, views, global, console),
        None => Err(Failure::usage("c4d edit: nothing says what to edit").next(
            "Give a folder of edited pictures with --views; `c4d freeze SCENE --views 24 -o FRAME` makes those to edit.",
        )),
    }
}
