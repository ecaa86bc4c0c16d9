//! Rules of the house that a compiler does not check. Each has a test that shows it can fail.

use crate::workspace;
use anyhow::{Context, Result, bail};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The only arrows allowed between our crates; `docs/ARCHITECTURE.md` explains them.
const ARROWS: &[(&str, &[&str])] = &[
    ("gs-core", &[]),
    ("uot", &[]),
    ("anchors", &[]),
    ("gs-deform", &["gs-core"]),
    ("gs-io", &["gs-core", "gs-deform"]),
    ("gs-player", &["gs-core"]),
    ("gs-raster-cpu", &["gs-core"]),
    ("gs-raster-wgpu", &["gs-core"]),
    ("gs-train-wgpu", &["gs-core", "gs-raster-wgpu", "cuar"]),
    ("cuar", &["gs-core"]),
    ("c4d-metrics", &["gs-core"]),
    ("gs-synth", &["gs-core", "gs-deform"]),
    ("amg", &["gs-core", "anchors", "uot"]),
    (
        "c4d-cli",
        &[
            "gs-core",
            "gs-deform",
            "gs-io",
            "gs-player",
            "gs-raster-cpu",
            "gs-raster-wgpu",
            "gs-synth",
            "gs-train-wgpu",
            "amg",
            "cuar",
            "c4d-metrics",
        ],
    ),
    ("test-support", &[]),
    ("xtask", &["gs-core", "gs-io", "gs-synth", "gs-raster-cpu", "amg"]),
];

/// Longest source file; beyond it a file holds more than one concept.
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
    for manifest in manifests(root)? {
        let text = fs::read_to_string(&manifest)?;
        check_arrows(&text, &mut found)?;
        let name = package_name(&text)?;
        if !architecture.contains(&format!("`{name}`")) {
            found.push(format!("docs/ARCHITECTURE.md does not mention `{name}`"));
        }
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
                found.push(format!("{place}: names a path of one machine"));
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

fn package_name(manifest: &str) -> Result<String> {
    let manifest: toml::Table = manifest.parse()?;
    let name = manifest.get("package").and_then(|p| p.get("name")).and_then(toml::Value::as_str);
    Ok(name.context("manifest without package name")?.to_owned())
}

/// Compares the manifest's dependencies on our crates with [`ARROWS`]; dev-dependencies may also reach `test-support` and, being
/// outside what is shipped, any crate.
fn check_arrows(manifest: &str, found: &mut Vec<String>) -> Result<()> {
    let name = package_name(manifest)?;
    let ours: BTreeSet<&str> = ARROWS.iter().map(|(crate_name, _)| *crate_name).collect();
    let Some((_, allowed)) = ARROWS.iter().find(|(crate_name, _)| *crate_name == name) else {
        found.push(format!("crate `{name}` is not in the table of xtask tidy"));
        return Ok(());
    };
    let manifest: toml::Table = manifest.parse()?;
    let Some(dependencies) = manifest.get("dependencies").and_then(toml::Value::as_table) else {
        return Ok(());
    };
    for dependency in dependencies.keys().filter(|key| ours.contains(key.as_str())) {
        if !allowed.contains(&dependency.as_str()) {
            found.push(format!("crate `{name}` may not depend on `{dependency}`"));
        }
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
    let tops = ["crates", "xtask", "shaders", "fixtures", "docs", ".ci"];
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
    fn an_upward_arrow_is_found() {
        let manifest = "[package]\nname = \"uot\"\n[dependencies]\namg = \"1\"\n";
        let mut found = Vec::new();
        check_arrows(manifest, &mut found).unwrap();
        assert_eq!(found, ["crate `uot` may not depend on `amg`"], "upward arrow");
    }

    #[test]
    fn an_unlisted_crate_is_found() {
        let mut found = Vec::new();
        check_arrows("[package]\nname = \"stray\"\n", &mut found).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
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
