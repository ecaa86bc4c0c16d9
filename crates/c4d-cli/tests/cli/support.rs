//! Helpers to run `c4d`.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

/// `c4d` with arguments.
pub(crate) fn c4d<A: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = A>) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("c4d"));
    command.args(arguments).env("NO_COLOR", "1");
    command
}

/// A path under `fixtures/`.
pub(crate) fn fixture(relative: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(relative)
}

/// Every file below `folder` except records of written files, relative, sorted.
pub(crate) fn listing(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut pending = vec![folder.to_owned()];
    while let Some(next) = pending.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                pending.push(path);
            } else if !path.to_string_lossy().ends_with(".c4d-files") {
                found.push(path.strip_prefix(folder).unwrap().display().to_string());
            }
        }
    }
    found.sort();
    found
}

/// Runs, expects failure with `code`, and returns standard error.
pub(crate) fn failure(command: &mut Command, code: i32) -> String {
    let output = command.output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "exit code; stderr: {stderr}");
    assert!(stderr.contains("error: "), "an error is announced: {stderr}");
    stderr
}

/// Runs, expects success, and returns standard output and standard error.
pub(crate) fn success(command: &mut Command) -> (String, String) {
    let output = command.output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{:?}; stderr: {stderr}", output.status);
    (String::from_utf8_lossy(&output.stdout).into_owned(), stderr)
}
