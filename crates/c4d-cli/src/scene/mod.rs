//! Scenes that commands work on, from any kind of path.

mod bad_input;
#[cfg(test)]
mod hostile;
mod open;
mod opened;
mod run;

pub(crate) use bad_input::bad_input;
pub(crate) use open::{open, open_run, open_with, refuse_model_flags};
pub(crate) use opened::{Opened, UP_CAPTURED};
pub(crate) use run::Run;
