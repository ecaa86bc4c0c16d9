//! `docs/TESTS.md`: the test suite with its times, generated from the output of `cargo test`.

use crate::workspace::workspace;
use anyhow::{Result, bail};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// First lines of the document.
const HEAD: &str = "# Tests

`cargo test --release --workspace` runs everything. Seconds are wall clock on two cores, without building. Generated with
`cargo test --release --workspace 2>&1 | tee tests.log` and `cargo xtask test-times tests.log`; `cargo xtask test-times` without a log
compares the rows with the test files.

| crate | tests | passed | seconds |
|---|---|---|---|
";

/// One test binary, or the documentation tests of one crate.
#[derive(Debug, PartialEq)]
struct Row {
    krate: String,
    /// Name of the test file, `unit` or `documentation`.
    tests: String,
    passed: usize,
    seconds: f64,
}

/// Writes the document from the log at `path`.
pub(crate) fn write(path: &Path) -> Result<()> {
    let rows = rows(&fs::read_to_string(path)?);
    if rows.is_empty() {
        bail!("{} contains no output of cargo test (both streams are needed)", path.display());
    }
    let mut out = HEAD.to_owned();
    for row in rows.iter().filter(|row| row.passed > 0) {
        let Row { krate, tests, passed, seconds } = row;
        writeln!(out, "| `{krate}` | {tests} | {passed} | {seconds:.1} |")?;
    }
    let passed: usize = rows.iter().map(|row| row.passed).sum();
    let seconds: f64 = rows.iter().map(|row| row.seconds).sum();
    writeln!(out, "| all | | {passed} | {seconds:.0} |")?;
    fs::write(workspace().join("docs/TESTS.md"), out)?;
    Ok(())
}

/// Compares the document with the test files of the workspace.
pub(crate) fn check() -> Result<()> {
    let root = workspace();
    let mut files = BTreeSet::new();
    for entry in fs::read_dir(root.join("crates"))? {
        let folder = entry?.path();
        let krate = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let tests = folder.join("tests");
        if !tests.is_dir() {
            continue;
        }
        for entry in fs::read_dir(tests)? {
            let path = entry?.path();
            let source = path.extension().is_some_and(|extension| extension == "rs");
            if source || path.join("main.rs").is_file() {
                let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                files.insert((krate.clone(), name));
            }
        }
    }
    let found = stale(&fs::read_to_string(root.join("docs/TESTS.md"))?, &files);
    if found.is_empty() {
        return Ok(());
    }
    bail!("{}", found.join("\n"))
}

fn rows(log: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    let (mut krate, mut tests) = (String::new(), String::new());
    for line in log.lines() {
        let line = line.trim();
        if let Some(running) = line.strip_prefix("Running ") {
            let file = running.strip_prefix("unittests ").unwrap_or(running);
            let name = running.rsplit(['/', '\\']).next().unwrap_or_default();
            let name = name.rsplit_once('-').map_or(name, |(name, _)| name);
            if file == running {
                name.clone_into(&mut tests);
            } else {
                krate = if name == "c4d" { "c4d-cli".to_owned() } else { name.replace('_', "-") };
                "unit".clone_into(&mut tests);
            }
        } else if let Some(name) = line.strip_prefix("Doc-tests ") {
            krate = name.replace('_', "-");
            "documentation".clone_into(&mut tests);
        } else if let Some(result) = line.strip_prefix("test result: ok. ") {
            let passed = result.split(' ').next().and_then(|count| count.parse().ok());
            let seconds = result
                .rsplit_once("finished in ")
                .and_then(|(_, secs)| secs.strip_suffix('s').and_then(|secs| secs.parse().ok()));
            if let (Some(passed), Some(seconds)) = (passed, seconds) {
                rows.push(Row { krate: krate.clone(), tests: tests.clone(), passed, seconds });
            }
        }
    }
    rows
}

/// Test files without a row in `document`, and rows without a test file.
/// `files` are pairs of crate and test-file name.
fn stale(document: &str, files: &BTreeSet<(String, String)>) -> Vec<String> {
    let listed: BTreeSet<(String, String)> = document
        .lines()
        .filter_map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let name = cells.get(1)?.strip_prefix('`')?.strip_suffix('`')?;
            Some((name.to_owned(), (*cells.get(2)?).to_owned()))
        })
        .filter(|(_, tests)| tests != "unit" && tests != "documentation")
        .collect();
    let missing = files.difference(&listed).map(|(krate, tests)| {
        format!("docs/TESTS.md has no row for `{tests}` of `{krate}`: cargo xtask test-times")
    });
    let gone = listed.difference(files).map(|(krate, tests)| {
        format!("docs/TESTS.md lists `{tests}` of `{krate}`, which is not a test file")
    });
    missing.chain(gone).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "     Running unittests src/lib.rs (target/release/deps/gs_core-0123)
running 2 tests
test result: ok. 2 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.01s
     Running tests/golden.rs (target/release/deps/golden_renders-4567)
test result: ok. 3 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 12.50s
   Doc-tests gs_core
test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.40s
";

    #[test]
    fn rows_are_read_from_a_log() {
        let row = |tests: &str, passed, seconds| Row {
            krate: "gs-core".to_owned(),
            tests: tests.to_owned(),
            passed,
            seconds,
        };
        let expected =
            [row("unit", 2, 0.01), row("golden_renders", 3, 12.5), row("documentation", 1, 0.4)];
        assert_eq!(rows(LOG), expected, "three rows");
        assert!(rows("error: nothing was built").is_empty(), "no rows");
    }

    #[test]
    fn rows_and_files_are_compared_both_ways() {
        let document =
            "| crate | tests |\n|---|---|\n| `a` | unit | 1 | 0.1 |\n| `a` | one | 1 | 0.1 |\n";
        let file = |name: &str| ("a".to_owned(), name.to_owned());
        assert!(stale(document, &[file("one")].into()).is_empty(), "agreement");
        assert_eq!(stale(document, &[file("one"), file("two")].into()).len(), 1, "missing row");
        assert_eq!(stale(document, &BTreeSet::new()).len(), 1, "missing file");
    }
}
