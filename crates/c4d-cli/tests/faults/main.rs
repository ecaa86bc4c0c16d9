//! Faults that no program can prevent: it is killed, the disk is full, memory runs out, another
//! process writes the same output. Whatever happens, outputs are complete or absent, nothing of the
//! user's is lost, and the next run works.

#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod disk;
mod kill;
mod memory;
mod outputs;
mod special_files;
#[path = "../cli/support.rs"]
mod support;
mod two_processes;
mod workshop;
