//! Scenes that commands work on, from any kind of path.

mod bad_input;
#[cfg(test)]
mod hostile;
mod open;
mod opened;
mod repaired;
mod run;

pub(crate) use bad_input::bad_input;
pub(crate) use open::{open, open_run, refuse_model_flags};
pub(crate) use opened::{Opened, UP_CAPTURED};
pub(crate) use repaired::say_repair;
pub(crate) use run::Run;
