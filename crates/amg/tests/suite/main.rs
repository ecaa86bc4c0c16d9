//! Tests of the motion stage: goldens, known motion, identity, and the promises of `docs/ARCHITECTURE.md`.

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
