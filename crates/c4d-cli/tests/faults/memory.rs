//! Memory runs out.

use crate::setup::Setup;
use crate::support::{c4d, failure, fixture};

/// Requests that exceed any machine's memory are refused with the size and the next step.
#[test]
fn sizes_beyond_any_memory_are_refused() {
    let setup = Setup::new();
    let (run, out) = (setup.text("run"), setup.text("out"));
    let demo = ["demo", "--splats", "4000000000000", "-o", &out];
    let stderr = failure(&mut c4d(demo), 1);
    assert!(stderr.contains("MiB") && stderr.contains("--splats"), "{stderr}");
    let image = "ulimit -v 4000000; exec \"$0\" \"$@\"";
    let mut shell = assert_cmd::Command::new("bash");
    shell.arg("-c").arg(image).arg(assert_cmd::cargo::cargo_bin!("c4d"));
    shell.args([
        "render",
        &run,
        "--threads",
        "1",
        "-g",
        "cpu",
        "--size",
        "16384x16384",
        "-o",
        &out,
    ]);
    let stderr = failure(&mut shell, 1);
    assert!(stderr.contains("268435456 pixels") && stderr.contains("--size"), "{stderr}");
    for (memory, code) in [("0", 2), ("3", 2), ("99999999999999", 1), ("-5", 2), ("much", 2)] {
        let stderr = failure_or_usage(&["refine", &run, &format!("--memory={memory}")], code);
        assert!(stderr.contains("--memory"), "{stderr}");
    }
    assert!(!setup.at("out").exists(), "no output is written");
}

fn failure_or_usage(arguments: &[&str], code: i32) -> String {
    let output = c4d(arguments).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
    stderr
}

/// A process with a memory limit works, or ends with an error about memory and without output.
#[test]
fn limited_processes_end_with_errors() {
    let setup = Setup::new();
    // A larger scene: the 3 frames of 84 kB of the fixture fit into
    // the memory of any process that starts.
    let source = fixture("synth/source");
    let large = setup.at("large.ply");
    let file = std::fs::File::create(&large).unwrap();
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 40000000\n";
    std::fs::write(&large, header).unwrap();
    file.set_len(3 << 30).unwrap();
    let script = "ulimit -v 1500000; exec \"$0\" \"$@\"";
    let mut shell = assert_cmd::Command::new("bash");
    shell.arg("-c").arg(script).arg(assert_cmd::cargo::cargo_bin!("c4d"));
    shell.args(["propagate", "--no-refine", "--threads", "2"]).arg(&source).arg("--edited");
    shell.arg(&large).arg("-o").arg(setup.at("out"));
    let stderr = failure(&mut shell, 1);
    assert!(stderr.contains("not enough memory") && stderr.contains("3072 MiB"), "{stderr}");
    assert!(stderr.contains("more memory"), "the next step is about memory: {stderr}");
    assert!(!setup.at("out").exists(), "no output is written");
}
