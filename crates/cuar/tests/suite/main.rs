//! Tests of the appearance stage: gradients, solvers, known truth, and edits as editors deliver them.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    reason = "a failed call fails the test; single precision is what is tested"
)]

mod common;
mod fuzzy;
mod gradient;
mod hidden;
mod losses;
mod monocular;
mod placement;
mod solvers;
mod truth;
mod whole_stage;
