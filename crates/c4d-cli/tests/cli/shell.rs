//! Completions, manual pages, and the exit codes listed in the help.

use crate::support::{c4d, failure, fixture, listing, success};
use std::process::Command;

const COMMANDS: [&str; 9] =
    ["info", "doctor", "freeze", "edit", "propagate", "refine", "render", "export", "demo"];

#[test]
fn completions_contain_every_command_and_parse() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let (script, _) = success(&mut c4d(["completions", shell]));
        for command in COMMANDS {
            assert!(script.contains(command), "{shell}: {command}");
        }
        assert!(script.contains("--edited") || script.contains("edited"), "{shell}: flags");
    }
    let (script, _) = success(&mut c4d(["completions", "bash"]));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c4d.bash");
    std::fs::write(&file, script).unwrap();
    // Windows does not include bash.
    if let Ok(status) = Command::new("bash").arg("-n").arg(&file).status() {
        assert!(status.success(), "bash parses its completions");
    }
    failure(&mut c4d(["completions", "csh"]), 2);
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("manual");
    let output = pages.to_str().unwrap();
    success(&mut c4d(["man", "-o", output]));
    let written = listing(&pages);
    for command in COMMANDS {
        let name = format!("man1/c4d-{command}.1");
        assert!(written.contains(&name), "{name} of {written:?}");
    }
    assert!(written.contains(&"man1/c4d-bench-motion.1".to_owned()), "{written:?}");
    let page = std::fs::read_to_string(pages.join("man1/c4d-propagate.1")).unwrap();
    assert!(page.contains("\\-\\-edited") && page.contains(".TH"), "flags, in roff");
    let root = std::fs::read_to_string(pages.join("man1/c4d.1")).unwrap();
    assert!(root.contains("Exit codes"), "exit codes");
    failure(&mut c4d(["man", "-o", output]), 2);
    success(&mut c4d(["man", "-o", output, "-w"]));
}

/// The exit codes that need no machine fault; 1 and 130 are tested with the faults.
#[test]
fn exit_codes_are_as_documented() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scene = fixture("synth/source").to_str().unwrap().to_owned();
    success(&mut c4d(["info", &scene]));
    failure(&mut c4d(["freeze", &scene, "-o", &at("a"), "--threads", "0"]), 2);
    std::fs::write(at("bad.ply"), "ply\nformat ascii 1.0\n").unwrap();
    failure(&mut c4d(["info", &at("bad.ply")]), 3);
    failure(&mut c4d(["render", &scene, "-o", &at("b"), "-g", "99"]), 4);
}

/// Text output has no colour codes if it goes to a file.
#[test]
fn nothing_is_coloured_in_a_pipe() {
    let scene = fixture("synth/source").to_str().unwrap().to_owned();
    let output = c4d(["info", &scene]).env_remove("NO_COLOR").env("TERM", "dumb").output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    assert!(!text.contains(&0x1b), "{}", String::from_utf8_lossy(&text));
}
