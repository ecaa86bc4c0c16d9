//! Two processes with the same output.

use crate::setup::{Setup, content};
use std::process::Stdio;

/// Of two concurrent processes, one writes the whole output; the
/// other either writes it later or is refused.
#[test]
fn one_output_is_written_by_one_process() {
    let setup = Setup::new();
    for job in setup.jobs() {
        let mut first = setup.command(&job, &[]).stderr(Stdio::piped()).spawn().unwrap();
        let second = setup.command(&job, &[]).stderr(Stdio::piped()).output().unwrap();
        let first_done = first.wait().unwrap().success();
        assert!(first_done ^ second.status.success(), "{}: exactly one writes it", job.name);
        let stderr = if first_done {
            String::from_utf8(second.stderr).unwrap()
        } else {
            std::io::read_to_string(first.stderr.take().unwrap()).unwrap()
        };
        assert!(
            stderr.contains("being written by another process")
                || stderr.contains("already exists"),
            "{}: {stderr}",
            job.name
        );
        let written = content(&setup.at(job.output));
        let mut again = assert_cmd::Command::from_std(setup.command(&job, &["-w"]));
        again.assert().success();
        assert!(written.keys().eq(content(&setup.at(job.output)).keys()), "{}", job.name);
    }
    let left: Vec<String> =
        setup.names().into_iter().filter(|name| name.starts_with('.')).collect();
    assert!(left.is_empty(), "no leftovers: {left:?}");
}
