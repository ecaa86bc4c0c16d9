//! The disk is full.

use crate::support::{failure, listing};
use crate::workshop::Workshop;
use std::process::Command;

/// Runs a command that cannot write any byte to a file and gets
/// an error instead, as on a full disk.
fn limited(command: &Command) -> assert_cmd::Command {
    let mut shell = assert_cmd::Command::new("bash");
    let script = "trap '' XFSZ; ulimit -f 0; exec \"$0\" \"$@\"";
    shell.arg("-c").arg(script).arg(command.get_program()).args(command.get_args());
    shell
}

/// Every command reports a full disk, and leaves neither a partial nor a changed output.
#[test]
fn full_disks_are_errors() {
    let workshop = Workshop::new();
    let before = listing(&workshop.at(""));
    for job in workshop.jobs() {
        let said = failure(&mut limited(&workshop.command(&job, &[])), 1);
        assert!(said.contains("cannot write") && said.contains("  next: "), "{}: {said}", job.name);
        assert_eq!(listing(&workshop.at("")), before, "{}: no output remains", job.name);
    }
}
