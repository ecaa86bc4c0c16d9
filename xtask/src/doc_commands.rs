//! Runs the commands in [`DOCUMENTS`]: every line of every `sh` block, in order, in one new folder,
//! with `c4d` on the path. A command may use the output of earlier ones. No shell is involved, so
//! this runs on every system: a line is a program and its arguments. The standard output of the
//! last command of a block is compared with the `output` block that follows it, if there is one.
//! A block with a file's name after its language, such as `toml suite.toml`, is that file.

use crate::expected_output;
use crate::workspace::workspace;
use anyhow::{Context, Result, bail};
use std::fs;
use std::process::{Command, Stdio};
use std::time::Instant;

const DOCUMENTS: &[&str] = &[
    "README.md",
    "docs/GETTING_STARTED.md",
    "docs/CONFIGURATION.md",
    "docs/EDITING.md",
    "docs/OUTPUTS.md",
    "docs/EVALUATION.md",
    "docs/SCALING.md",
    "docs/ARCHITECTURE.md",
    "docs/BENCHMARKS.md",
    "docs/DEVIATIONS.md",
];
/// Commands skipped here because the continuous-integration script runs them.
const RUN_ELSEWHERE: &[&str] = &["git clone", "cd ", "cargo test", "cargo install", "sudo apt-get"];

/// Number of commands in the list of the slowest.
const SLOWEST: usize = 12;

pub(crate) fn run() -> Result<()> {
    let root = workspace();
    let folder = root.join("target/doc-commands");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    // Build all programs, examples and benches together: dependencies then have the same features
    // as in the test suite, and neither this build nor a documented command rebuilds them.
    let built = Command::new("cargo")
        .args(["build", "--release", "--quiet", "--workspace", "--bins", "--examples", "--benches"])
        .current_dir(&root)
        .env("CARGO_TARGET_DIR", root.join("target"))
        .status()?;
    if !built.success() {
        bail!("c4d does not build");
    }
    // Where `cargo install` would have put the program.
    let inherited = std::env::var_os("PATH").unwrap_or_default();
    let folders =
        std::iter::once(root.join("target/release")).chain(std::env::split_paths(&inherited));
    let path = std::env::join_paths(folders)?;
    let mut times: Vec<(f64, String)> = Vec::new();
    for document in DOCUMENTS {
        let text =
            fs::read_to_string(root.join(document)).with_context(|| (*document).to_owned())?;
        for (name, content) in files(&text) {
            fs::write(folder.join(&name), content)
                .with_context(|| format!("{document}: {name}"))?;
        }
        for Documented { line, output } in commands(&text) {
            if RUN_ELSEWHERE.iter().any(|prefix| line.starts_with(prefix)) {
                continue;
            }
            // Built above; on its own, it would be built again with other features of dependencies.
            let line = line.replacen("cargo run --release --bin c4d --", "c4d", 1);
            // A full benchmark takes minutes; this only checks that it runs.
            let line = if line.starts_with("cargo bench") { line + " -- --test" } else { line };
            eprintln!("{document}: {line}");
            let begun = Instant::now();
            refuse_package_flag(&line).with_context(|| (*document).to_owned())?;
            let words = words(&line).with_context(|| format!("{document}: `{line}`"))?;
            let ran = Command::new(&words[0])
                .args(&words[1..])
                .current_dir(&folder)
                .env("CARGO_TARGET_DIR", root.join("target"))
                .env("PATH", &path)
                .stdin(Stdio::null())
                .stdout(if output.is_some() { Stdio::piped() } else { Stdio::inherit() })
                .stderr(Stdio::inherit())
                .output()
                .with_context(|| line.clone())?;
            if !ran.status.success() {
                bail!("{document}: `{line}` ended with {}", ran.status);
            }
            if let Some(expected) = output {
                let printed = String::from_utf8_lossy(&ran.stdout);
                expected_output::compare(&expected, &printed)
                    .with_context(|| format!("{document}: `{line}`"))?;
            }
            times.push((begun.elapsed().as_secs_f64(), format!("{document}: {line}")));
        }
    }
    times.sort_by(|a, b| b.0.total_cmp(&a.0));
    eprintln!("\nslowest:");
    for (secs, line) in times.iter().take(SLOWEST) {
        eprintln!("{secs:7.1} s  {line}");
    }
    let total: f64 = times.iter().map(|(secs, _)| secs).sum();
    eprintln!("{} documented commands ran in {total:.0} s", times.len());
    Ok(())
}

/// Rejects `-p` in a documented `cargo` command: it would rebuild the
/// dependencies with that package's features alone, which takes minutes.
/// `--example`, `--bench` and `--bin` find their target in any package.
fn refuse_package_flag(line: &str) -> Result<()> {
    let own = line.split(" -- ").next().unwrap_or_default();
    if own.starts_with("cargo ") && own.split(' ').any(|word| matches!(word, "-p" | "--package")) {
        bail!("`{line}` selects a package; name the target with --example, --bench or --bin");
    }
    Ok(())
}

/// Splits a line into program and arguments.
///
/// # Errors
/// If the line needs a shell.
fn words(line: &str) -> Result<Vec<String>> {
    // Text in single quotes needs no shell.
    let unquoted: String = line.split('\'').step_by(2).collect();
    if let Some(found) = unquoted.chars().find(|c| "|&;<>$`*?(){}".contains(*c)) {
        bail!("`{found}` needs a shell; documented commands run without one");
    }
    let words = shlex::split(line).context("an unclosed quote")?;
    if words.is_empty() {
        bail!("no command");
    }
    Ok(words)
}

/// A command of a document.
#[derive(Debug, PartialEq, Eq)]
struct Documented {
    line: String,
    /// The output shown in the document.
    output: Option<String>,
}

/// Lines of the `sh` blocks; a trailing backslash joins lines; comments are skipped. `cargo` finds
/// the workspace from a folder below it, so commands are run as written.
fn commands(text: &str) -> Vec<Documented> {
    let mut block = None;
    let mut found: Vec<Documented> = Vec::new();
    let mut joined = String::new();
    // Whether only empty lines have followed the last `sh` block.
    let mut follows = false;
    for line in text.lines() {
        if let Some(fence) = line.trim_start().strip_prefix("```") {
            let fence = fence.trim();
            block = if block.is_some() { None } else { Some(fence) };
            if let (Some("output"), true, Some(last)) = (block, follows, found.last_mut()) {
                last.output = Some(String::new());
            }
            follows = fence.is_empty() && follows || block == Some("sh");
            continue;
        }
        match block {
            Some("output") => {
                if let Some(output) = found.last_mut().and_then(|last| last.output.as_mut()) {
                    output.push_str(line);
                    output.push('\n');
                }
            }
            Some("sh") => {
                let line = line.trim();
                if line.is_empty() || line.starts_with('#') {
                    continue;
                }
                if let Some(start) = line.strip_suffix('\\') {
                    joined.push_str(start);
                    continue;
                }
                joined.push_str(line);
                found.push(Documented { line: std::mem::take(&mut joined), output: None });
            }
            _ => follows &= line.trim().is_empty(),
        }
    }
    found
}

/// Names and contents of the files in the document.
fn files(text: &str) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    let mut block = None;
    for line in text.lines() {
        match (line.strip_prefix("```"), block) {
            (Some(fence), None) => {
                let name = fence.split_once(' ').map(|(_, name)| name.trim().to_owned());
                block = Some(name.is_some());
                found.extend(name.map(|name| (name, String::new())));
            }
            (Some(_), Some(_)) => block = None,
            (None, Some(true)) => {
                if let Some((_, content)) = found.last_mut() {
                    content.push_str(line);
                    content.push('\n');
                }
            }
            (None, _) => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_with_a_name_is_a_file() {
        let text = "```toml\na = 1\n```\n```toml b.toml\n[b]\nc = 2\n```\n```sh\nd\n```\n";
        assert_eq!(files(text), [("b.toml".to_owned(), "[b]\nc = 2\n".to_owned())], "one");
        assert_eq!(commands(text).len(), 1, "and one command");
    }

    #[test]
    fn only_sh_blocks_are_commands() {
        let text = "```sh\n# note\na \\\n  b\nc\n```\n```text\nd\n```\ne";
        let lines: Vec<String> = commands(text).into_iter().map(|found| found.line).collect();
        assert_eq!(lines, ["a b", "c"], "joined, in order");
    }

    #[test]
    fn an_output_block_belongs_to_the_command_before_it() {
        let text = "```sh\na\nb\n```\n\n```output\n1 s\n2 s\n```\n\n```sh\nc\n```\nWords.\n```output\n3\n```\n";
        let outputs: Vec<_> = commands(text).into_iter().map(|found| found.output).collect();
        assert_eq!(outputs, [None, Some("1 s\n2 s\n".to_owned()), None], "directly after it");
    }

    #[test]
    fn documented_commands_share_their_builds() {
        assert!(
            refuse_package_flag("cargo run --release --example sizes -- -p 3").is_ok(),
            "its own"
        );
        assert!(refuse_package_flag("cargo bench -p anchors").is_err(), "a package");
    }

    #[test]
    fn lines_are_split_without_a_shell() {
        assert_eq!(words("c4d info 'my scene'").unwrap(), ["c4d", "info", "my scene"], "quotes");
        assert!(words("c4d info a | head").is_err(), "a pipe");
        assert_eq!(words("c4d edit 'a & b'").unwrap()[2], "a & b", "quoted operators");
        assert!(words("c4d edit 'a' & b").is_err(), "operators after quotes");
        assert!(words("c4d info 'a").is_err(), "an unclosed quote");
    }
}
