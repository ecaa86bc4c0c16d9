//! Documentation that lies is found by running it: every line of every `sh` block of the documents below is executed, in
//! order, in one fresh folder, with `c4d` on the path. A document's commands may use what earlier ones wrote.

use crate::workspace;
use anyhow::{Context, Result, bail};
use std::fs;
use std::process::Command;

const DOCUMENTS: &[&str] =
    &["README.md", "docs/ARCHITECTURE.md", "docs/BENCHMARKS.md", "docs/DEVIATIONS.md"];
/// Commands that the continuous-integration script itself runs; naming them here is the list of exceptions.
const RUN_ELSEWHERE: &[&str] = &["git clone", "cd ", "cargo test", "cargo install", "sudo apt-get"];

pub(crate) fn run() -> Result<()> {
    let root = workspace();
    let folder = root.join("target/doc-commands");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    let built = Command::new("cargo")
        .args(["build", "--release", "--quiet", "--package", "c4d-cli"])
        .current_dir(&root)
        .env("CARGO_TARGET_DIR", root.join("target"))
        .status()?;
    if !built.success() {
        bail!("c4d does not build");
    }
    // What `cargo install` would have put on the path.
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", root.join("target/release").display());
    let mut count = 0;
    for document in DOCUMENTS {
        let text =
            fs::read_to_string(root.join(document)).with_context(|| (*document).to_owned())?;
        for line in commands(&text) {
            if RUN_ELSEWHERE.iter().any(|prefix| line.starts_with(prefix)) {
                continue;
            }
            // Benches measure for minutes; here it matters that they run at all.
            let line = if line.starts_with("cargo bench") { line + " -- --test" } else { line };
            eprintln!("{document}: {line}");
            let status = Command::new("bash")
                .args(["-euo", "pipefail", "-c", &line])
                .current_dir(&folder)
                .env("CARGO_TARGET_DIR", root.join("target"))
                .env("PATH", &path)
                .status()
                .with_context(|| line.clone())?;
            if !status.success() {
                bail!("{document}: `{line}` ended with {status}");
            }
            count += 1;
        }
    }
    eprintln!("{count} documented commands ran");
    Ok(())
}

/// Lines of the `sh` blocks; a trailing backslash joins lines; comments are skipped. `cargo` finds the workspace from a folder
/// below it, so commands are run as written.
fn commands(text: &str) -> Vec<String> {
    let mut inside = false;
    let mut found: Vec<String> = Vec::new();
    let mut joined = String::new();
    for line in text.lines() {
        if let Some(fence) = line.trim_start().strip_prefix("```") {
            inside = fence.trim() == "sh";
            continue;
        }
        let line = line.trim();
        if !inside || line.is_empty() || line.starts_with('#') {
            continue;
        }
        if let Some(start) = line.strip_suffix('\\') {
            joined.push_str(start);
            continue;
        }
        joined.push_str(line);
        found.push(std::mem::take(&mut joined));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_sh_blocks_are_commands() {
        let text = "```sh\n# note\na \\\n  b\nc\n```\n```text\nd\n```\ne";
        assert_eq!(commands(text), ["a b", "c"], "joined, in order");
    }
}
