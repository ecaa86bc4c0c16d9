//! Other tools, installed from their registries into a scratch folder.

use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Versions of PlayCanvas's converter: the last one whose SPZ uses the
/// axes of the specification, and a later one.
const SPLAT_TRANSFORM: [&str; 2] = ["2.7.1", "3.7.0"];
/// Versions of the Python packages.
const GSPLY: &str = "0.4.6";
const USD: &str = "26.11";
const FOURDGS: &str = "0.6.0";

/// A tool that converts frames.
pub(super) enum Peer {
    SplatTransform { version: &'static str, program: PathBuf },
    Gsply { python: PathBuf },
}

/// A format, with flags of `c4d export`.
pub(super) type Written = (&'static str, &'static [&'static str]);

/// File extension of a format, whose name may be followed by a version.
pub(super) fn ending(format: &str) -> String {
    format!(".{}", format.split(' ').next().unwrap_or(format))
}

/// The OpenUSD library, with its version.
pub(super) fn usd() -> String {
    format!("usd-core {USD}")
}

/// The reference reader of `.4dgs`, with its version.
pub(super) fn fourdgs() -> String {
    format!("fourdgs {FOURDGS}")
}

/// Python with these packages.
pub(super) fn python(folder: &Path) -> Command {
    Command::new(folder.join("python/bin/python"))
}

pub(super) fn checked(command: &mut Command) -> Result<Output> {
    let output = command.output().with_context(|| format!("{command:?} does not start"))?;
    if output.status.success() {
        return Ok(output);
    }
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no message");
    bail!("{}", last.trim().to_owned())
}

impl Peer {
    /// Installs all tools in `folder`, unless they are already installed.
    pub(super) fn install_all(folder: &Path) -> Result<Vec<Self>> {
        let mut peers = Vec::new();
        for version in SPLAT_TRANSFORM {
            let prefix = folder.join(format!("splat-transform-{version}"));
            let program = prefix.join("node_modules/.bin/splat-transform");
            if !program.exists() {
                std::fs::create_dir_all(&prefix)?;
                let package = format!("@playcanvas/splat-transform@{version}");
                checked(
                    Command::new("npm")
                        .args(["install", "--no-audit", "--no-fund", "--prefix"])
                        .arg(&prefix)
                        .arg(package),
                )?;
            }
            peers.push(Self::SplatTransform { version, program });
        }
        let environment = folder.join("python");
        if !environment.exists() {
            checked(Command::new("python3").args(["-m", "venv"]).arg(&environment))?;
        }
        checked(
            python(folder)
                .args(["-m", "pip", "install", "--quiet"])
                .args([format!("gsply[sogs,spz]=={GSPLY}"), format!("usd-core=={USD}")])
                .arg(format!("fourdgs=={FOURDGS}")),
        )?;
        peers.push(Self::Gsply { python: environment.join("bin/python") });
        Ok(peers)
    }

    pub(super) fn name(&self) -> String {
        match self {
            Self::SplatTransform { version, .. } => format!("splat-transform {version}"),
            Self::Gsply { .. } => format!("gsply {GSPLY}"),
        }
    }

    /// Name with the registry.
    pub(super) fn origin(&self) -> String {
        let registry = match self {
            Self::SplatTransform { .. } => "npm, `@playcanvas/splat-transform`",
            Self::Gsply { .. } => "PyPI",
        };
        format!("{} ({registry})", self.name())
    }

    /// Formats that the tool writes and `c4d` reads.
    pub(super) fn writes(&self) -> &'static [&'static str] {
        match self {
            Self::SplatTransform { .. } => {
                &["ply", "compressed.ply", "spz 3", "spz 4", "sog", "glb"]
            }
            Self::Gsply { .. } => &["ply", "compressed.ply", "spz 3", "spz 4"],
        }
    }

    /// Formats that the tool reads and `c4d` writes.
    pub(super) fn reads(&self) -> &'static [Written] {
        match self {
            Self::SplatTransform { .. } => &[
                ("ply", &[]),
                ("compressed.ply", &[]),
                ("spz", &[]),
                ("spz", &["--spz-axes", "ply"]),
                ("spz", &["--spz-version", "4"]),
                ("spz", &["--spz-axes", "ply", "--spz-version", "4"]),
                ("splat", &[]),
            ],
            Self::Gsply { .. } => &[
                ("ply", &[]),
                ("compressed.ply", &[]),
                ("spz", &[]),
                ("spz", &["--spz-axes", "ply"]),
                ("spz", &["--spz-axes", "ply", "--spz-version", "4"]),
            ],
        }
    }

    /// Converts the file with extension `from` in `folder` to the one with extension `to`.
    pub(super) fn convert(&self, folder: &Path, from: &str, to: &str, format: &str) -> Result<()> {
        match self {
            Self::SplatTransform { program, .. } => {
                let mut command = Command::new(program);
                command.current_dir(folder).args(["-w", "-q", "-g", "cpu"]);
                if let Some(version) = format.strip_prefix("spz ") {
                    command.args(["--spz-version", version]);
                }
                checked(command.args([from, to])).map(drop)
            }
            Self::Gsply { python } => {
                let script = include_str!("gsply.py");
                let version = format.strip_prefix("spz ").unwrap_or("3");
                let arguments = ["-c", script, from, to, version];
                checked(Command::new(python).current_dir(folder).args(arguments)).map(drop)
            }
        }
    }
}
