//! The program `c4d` as a library: every command in this process, and scenes and runs as `c4d`
//! opens them.
//!
//! [`run_command`] does what the program does for the same arguments. [`SceneHandle`] gives the
//! splats and images of a scene, run or frame in memory; [`RunContents`] the arrays of a run.
//! Messages and progress go to an [`Observer`].
//!
//! Contains commands, progress, run folders and messages. Deliberately
//! absent: algorithms, which are in the other crates.

mod animated_image;
mod args;
mod camera_rig;
mod cameras;
mod caption;
mod clip_file;
mod commands;
mod console;
mod device;
mod dispatch;
mod edited_axes;
mod evaluation;
mod evidence;
mod failure;
mod features;
mod field;
mod frames;
mod images;
mod in_process;
mod json_report;
mod lifetimes;
mod memory;
mod model_flags;
mod observer;
mod output;
mod overlays;
mod part;
mod passes;
mod placement;
mod progress;
mod rates;
mod rendered;
mod renderer;
mod report;
mod rigid_parts;
mod run_contents;
mod run_folder;
mod scene;
mod scene_handle;
mod settings;
mod stages;
mod still;
mod suggestion;
mod terminal;
mod threads;
#[cfg(feature = "mp4")]
mod video;

pub use cameras::open_cameras;
pub use failure::{Exit, Failure, Outcome};
pub use in_process::run_command;
pub use observer::{MessageKind, Observer};
pub use rendered::RenderedImage;
pub use run_contents::RunContents;
pub use scene_handle::SceneHandle;
pub use terminal::main;
pub use threads::start_threads;

/// Runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
