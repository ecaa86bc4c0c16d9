//! Tests of readers and writers: files of other programs, goldens, layouts, and files that are damaged or hostile.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "a failed call fails the test; known values in known ranges"
)]

mod cameras;
mod cameras_hostile;
mod common;
mod detect;
mod frame_sequence;
mod frames;
mod fuzz;
mod gltf;
mod golden_4dgs;
mod golden_cameras;
mod golden_sources;
mod golden_swift4d;
mod model_folder;
mod ply;
mod sequence;
mod sog;
mod source_layouts;
mod sources_hostile;
mod sources_mutated;
mod splat4d;
mod splatv;
mod swift4d_folder;
mod tsog;
mod usda;
mod user_files;
mod write_model;
