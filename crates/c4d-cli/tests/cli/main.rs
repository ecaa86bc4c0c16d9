//! `c4d` on the command line: the main workflow end to end, and invalid inputs.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod bad_input;
mod cameras;
mod command_line;
mod compare;
mod configuration;
mod edit_pictures;
mod eval;
mod exports;
mod formats;
mod gpu;
mod html;
mod images;
mod json;
mod lifetimes;
mod moved_edits;
mod neural;
mod operations;
mod overlays;
mod parts;
mod placement;
mod scaling;
mod shell;
mod sources;
mod suite;
mod support;
mod swift4d;
mod synth_run;
mod view;
mod workflow;
