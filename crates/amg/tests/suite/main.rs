//! Tests of the motion stage: goldens, known motion, identity, and the promises of
//! `docs/ARCHITECTURE.md`.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a failed call fails the test; sizes and lengths are small"
)]

mod captured;
mod common;
mod generalise;
mod golden;
mod graft;
mod identity;
mod invariance;
mod moved;
mod promises;
mod properties;
mod scene;
mod surface;
