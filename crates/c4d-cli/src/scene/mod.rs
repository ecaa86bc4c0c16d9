//! Scenes that commands work on, from any kind of path.

mod bad_input;
#[cfg(test)]
mod damaged_runs;
mod loaded_scene;
mod open;
mod run;

pub(crate) use bad_input::bad_input;
pub(crate) use loaded_scene::{LoadedScene, UP_CAPTURED};
pub(crate) use open::{open, open_run, open_with, refuse_model_flags};
pub(crate) use run::Run;
