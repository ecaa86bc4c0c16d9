//! Checks the table of promises in `docs/ARCHITECTURE.md`: every promise has a test, and every
//! named test exists. Files named elsewhere in that document must also exist.

use std::fs;
use std::path::Path;

/// Heading of the table.
const HEADING: &str = "## Promises";

/// Problems with the promises in `text`.
pub(super) fn check(root: &Path, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let rows = rows(text);
    if rows.is_empty() {
        found.push(format!("docs/ARCHITECTURE.md: no table below `{HEADING}`"));
    }
    for [promise, tests] in rows {
        let names: Vec<&str> = quoted(tests).collect();
        if names.is_empty() {
            found.push(format!("docs/ARCHITECTURE.md: no test for `{promise}`"));
        }
        for name in names {
            if !exists(root, name) {
                found.push(format!("docs/ARCHITECTURE.md: no test `{name}`"));
            }
        }
    }
    for path in quoted(text).filter(|path| is_path(path)) {
        if !["", "crates"].iter().any(|folder| root.join(folder).join(path).exists()) {
            found.push(format!("docs/ARCHITECTURE.md: no file `{path}`"));
        }
    }
    found
}

/// Promise and tests of each row of the table.
fn rows(text: &str) -> Vec<[&str; 2]> {
    let Some((_, section)) = text.split_once(HEADING) else { return Vec::new() };
    let section = section.split("\n## ").next().unwrap_or_default();
    let lines = section.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |"));
    lines.filter_map(|line| line.split_once(" | ")).skip(1).map(|(a, b)| [a, b]).collect()
}

/// Texts in backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.lines().flat_map(|line| line.split('`').skip(1).step_by(2))
}

/// Whether a quoted text is the path of a source file.
fn is_path(text: &str) -> bool {
    let placeholder = text
        .split(['/', '.'])
        .any(|part| !part.is_empty() && part.chars().all(|c| c.is_ascii_uppercase()));
    let source = Path::new(text).extension().is_some_and(|e| e == "rs" || e == "wgsl");
    source && text.contains('/') && !placeholder && !text.contains("::")
}

/// Whether `crate/path/file.rs::test` names a test: a function with the attribute `#[test]`.
fn exists(root: &Path, name: &str) -> bool {
    let Some((file, test)) = name.split_once("::") else { return false };
    let text = fs::read_to_string(root.join("crates").join(file)).unwrap_or_default();
    let lines: Vec<&str> = text.lines().map(str::trim_start).collect();
    let declaration = format!("fn {test}(");
    let is_test = |at: usize| {
        let above = lines[..at].iter().rev();
        above.take_while(|line| !["", "}"].contains(line)).any(|line| *line == "#[test]")
    };
    (0..lines.len()).any(|at| lines[at].starts_with(&declaration) && is_test(at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::workspace;

    const GOOD: &str = "## Promises\n\n| promise | tests |\n|---|---|\n\
        | threads | `uot/tests/properties.rs::any_number_of_threads_gives_the_same_bits` |\n";

    #[test]
    fn missing_tests_files_and_tables_are_found() {
        let root = workspace();
        let count = |text: &str| check(&root, text).len();
        assert_eq!(count(GOOD), 0, "a promise with its test");
        let renamed = GOOD.replace("any_number", "no_number");
        assert_eq!(count(&renamed), 1, "no such test");
        let helper = "`test-support/src/noise.rs::noise_pair`";
        let helped = format!("{GOOD}| noise | {helper} |\n");
        assert_eq!(count(&helped), 1, "a function that is not a test");
        assert_eq!(count(&GOOD.replace("properties.rs", "none.rs")), 1, "no such file");
        assert_eq!(count(&format!("{GOOD}| silence | – |\n")), 1, "a promise without a test");
        assert_eq!(count("# Architecture"), 1, "no table");
        assert_eq!(count(&format!("{GOOD}\nSee `gs-core/src/nothing.rs`.")), 1, "a missing file");
        assert_eq!(count(&format!("{GOOD}\nSee `gs-core/src/lib.rs`.")), 0, "a file");
    }
}
