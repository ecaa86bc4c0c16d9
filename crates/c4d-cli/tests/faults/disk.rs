//! The disk is full.

use crate::setup::Setup;
use crate::support::{failure, listing};
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
    let setup = Setup::new();
    let before = listing(&setup.at(""));
    for job in setup.jobs() {
        let stderr = failure(&mut limited(&setup.command(&job, &[])), 1);
        assert!(
            stderr.contains("cannot write") && stderr.contains("  next: "),
            "{}: {stderr}",
            job.name
        );
        assert_eq!(listing(&setup.at("")), before, "{}: no output remains", job.name);
    }
}
