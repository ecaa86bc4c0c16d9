//! Tests of the crate's guarantees against brute force, closed forms and invariances.

#![expect(clippy::unwrap_used, reason = "a failed call fails the test; helpers count as tests")]

mod cylinder;
mod degenerate;
mod farthest;
mod grouping;
mod invariance;
mod lines;
mod neighbors;
mod scenes;
mod sphere;
