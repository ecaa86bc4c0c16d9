//! External faults: the process is killed, the disk is full, memory runs out,
//! another process writes the same output. In all cases outputs are complete or
//! absent, no user data is lost, and the next run works.

#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod disk;
mod kill;
mod memory;
mod outputs;
mod setup;
mod special_files;
#[path = "../cli/support.rs"]
mod support;
mod two_processes;
