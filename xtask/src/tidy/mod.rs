//! Rules that the compiler does not check. Each has a test in which it fails.

mod crate_table;
mod import_graph;
mod promises;

use crate::workspace::workspace;
use anyhow::{Context, Result, bail};
use crate_table::CrateTable;
use import_graph::ImportGraph;
use std::fs;
use std::path::{Path, PathBuf};

/// Maximum number of lines of a source file; longer files cover more than one concept.
const MAX_LINES: usize = 600;
/// Highest equation number of the paper with its supplement.
const LAST_EQUATION: u32 = 24;
/// Largest file in the repository, bytes.
const MAX_BYTES: u64 = 3_000_000;

pub(crate) fn run() -> Result<()> {
    let findings = findings(&workspace())?;
    if findings.is_empty() {
        return Ok(());
    }
    bail!("tidy:\n  {}", findings.join("\n  "))
}

fn findings(root: &Path) -> Result<Vec<String>> {
    let mut found = Vec::new();
    let architecture = fs::read_to_string(root.join("docs/ARCHITECTURE.md"))
        .context("docs/ARCHITECTURE.md is missing")?;
    let manifests = manifests(root)?;
    let texts = manifests.iter().map(fs::read_to_string).collect::<Result<Vec<_>, _>>()?;
    found.extend(CrateTable::parse(&architecture)?.compare(&texts)?);
    found.extend(promises::check(root, &architecture));
    for folder in manifests.iter().filter_map(|manifest| manifest.parent()) {
        check_readme(root, folder, &mut found)?;
        check_cycles(folder, &mut found)?;
    }
    for file in files(root)? {
        let shown = file.strip_prefix(root).unwrap_or(&file).display().to_string();
        if fs::metadata(&file)?.len() > MAX_BYTES {
            found.push(format!("{shown}: larger than {MAX_BYTES} bytes"));
        }
        let extension = file.extension().and_then(|e| e.to_str()).unwrap_or_default();
        if matches!(extension, "rs" | "wgsl" | "md" | "toml" | "py" | "sh" | "yml") {
            let text = fs::read_to_string(&file)?;
            check_text(&shown, extension, &text, &mut found);
        }
    }
    Ok(found)
}

fn check_text(shown: &str, extension: &str, text: &str, found: &mut Vec<String>) {
    if matches!(extension, "rs" | "wgsl") && text.lines().count() > MAX_LINES {
        found.push(format!("{shown}: more than {MAX_LINES} lines"));
    }
    for (number, line) in text.lines().enumerate() {
        let place = format!("{shown}:{}", number + 1);
        for folder in ["work", "tmp", "root", "home"] {
            if line.contains(&format!("\u{2f}{folder}/")) {
                found.push(format!("{place}: contains a machine-specific path"));
            }
        }
        for equation in equations(line) {
            if !(1..=LAST_EQUATION).contains(&equation) {
                found.push(format!("{place}: the paper has no Eq. {equation}"));
            }
        }
    }
}

/// Numbers after `Eq.` in a line.
fn equations(line: &str) -> Vec<u32> {
    line.split("Eq. ")
        .skip(1)
        .filter_map(|rest| {
            let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
            digits.parse().ok()
        })
        .collect()
}

/// Every library has a README that is compiled as a doctest.
fn check_readme(root: &Path, folder: &Path, found: &mut Vec<String>) -> Result<()> {
    let shown = folder.strip_prefix(root).unwrap_or(folder).display();
    if !folder.join("README.md").is_file() {
        found.push(format!("{shown}: no README.md"));
    }
    let library = folder.join("src/lib.rs");
    if library.is_file() && !fs::read_to_string(library)?.contains("include_str!(\"../README.md\")")
    {
        found.push(format!("{shown}/src/lib.rs: does not compile its README.md as a doctest"));
    }
    Ok(())
}

/// Files of a crate may not import each other in cycles.
fn check_cycles(folder: &Path, found: &mut Vec<String>) -> Result<()> {
    let name = folder.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let roots = ["src/lib.rs", "src/main.rs"].map(|root| folder.join(root));
    let root = roots.iter().find(|root| root.is_file()).context("a crate has a root file")?;
    let graph = ImportGraph::read(root)?;
    let cycles = graph.cycles();
    let files: usize = cycles.iter().map(Vec::len).sum();
    if files > 0 {
        let drawn: Vec<String> = cycles.iter().map(|cycle| graph.describe(cycle)).collect();
        found.push(format!(
            "crate `{name}`: {files} files import each other in a cycle:\n{}",
            drawn.join("\n    and\n")
        ));
    }
    Ok(())
}

fn manifests(root: &Path) -> Result<Vec<PathBuf>> {
    let mut manifests = vec![root.join("xtask/Cargo.toml")];
    for entry in fs::read_dir(root.join("crates"))? {
        manifests.push(entry?.path().join("Cargo.toml"));
    }
    manifests.sort();
    Ok(manifests)
}

/// Every file of the repository outside `target`, version control and output folders.
fn files(root: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let tops = ["crates", "xtask", "shaders", "fixtures", "docs", ".ci", ".github"];
    let mut folders: Vec<PathBuf> =
        tops.iter().map(|top| root.join(top)).filter(|folder| folder.is_dir()).collect();
    for entry in fs::read_dir(root)? {
        let path = entry?.path();
        if path.is_file() {
            files.push(path);
        }
    }
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            let target = path.file_name().is_some_and(|name| name == "target");
            match (path.is_dir(), target) {
                (true, false) => folders.push(path),
                (true, true) => {}
                (false, _) => files.push(path),
            }
        }
    }
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workspace_is_tidy() {
        let findings = findings(&workspace()).unwrap();
        assert!(findings.is_empty(), "{}", findings.join("\n"));
    }

    #[test]
    fn bad_text_is_found() {
        let text = format!("// see {} 99\n// {}home/me/data\n", "Eq.", '\u{2f}');
        let mut found = Vec::new();
        check_text("x.rs", "rs", &text, &mut found);
        assert_eq!(found.len(), 2, "{found:?}");
        check_text("x.rs", "rs", &"\n".repeat(MAX_LINES + 1), &mut found);
        assert_eq!(found.len(), 3, "{found:?}");
    }
}
