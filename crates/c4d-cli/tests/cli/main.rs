//! `c4d` as users run it: the main job end to end, and wrong inputs.

mod bad_input;
mod main_job;
mod support;
