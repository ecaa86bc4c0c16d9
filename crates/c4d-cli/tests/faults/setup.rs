//! Small inputs, and all commands that write.

use crate::support::{c4d, fixture, success};
use gs_io::{Existing, ply};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder with a scene, an edit and a run.
pub(crate) struct Setup {
    folder: TempDir,
}

/// A command line that writes one output.
#[derive(Debug, Clone)]
pub(crate) struct Job {
    pub(crate) name: &'static str,
    /// Without the output.
    pub(crate) arguments: Vec<String>,
    /// Name of the output.
    pub(crate) output: &'static str,
}

impl Setup {
    /// A sequence, an edit of it, and a run.
    pub(crate) fn new() -> Self {
        let setup = Self { folder: tempfile::tempdir().unwrap() };
        let (source, edited) = (fixture("synth/source"), setup.at("edited.ply"));
        fs::copy(fixture("synth/edited.ply"), &edited).unwrap();
        let run = setup.text("run");
        let edited = setup.text("edited.ply");
        let source = source.to_str().unwrap();
        success(&mut c4d(["propagate", source, "--edited", &edited, "--no-refine", "-o", &run]));
        setup
    }

    pub(crate) fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn text(&self, name: &str) -> String {
        self.at(name).to_str().unwrap().to_owned()
    }

    /// One job for every command that writes and every kind of output.
    pub(crate) fn jobs(&self) -> Vec<Job> {
        let (source, run) = (fixture("synth/source"), self.text("run"));
        let source = source.to_str().unwrap();
        let edited = self.text("edited.ply");
        let job = |name, arguments: &[&str], output| Job {
            name,
            arguments: arguments.iter().map(|&argument| argument.to_owned()).collect(),
            output,
        };
        let small = ["--size", "48x48", "--frames", "3", "-g", "cpu"];
        let render = |extra: &[&'static str]| -> Vec<&str> {
            ["render", run.as_str()].iter().chain(&small).chain(extra).copied().collect()
        };
        let export = |to| vec!["export", run.as_str(), "--frames", "3", "--to", to];
        vec![
            job("freeze", &["freeze", source], "frozen"),
            job("propagate", &["propagate", source, "--edited", &edited, "--no-refine"], "again"),
            job("stills", &render(&["--passes", "rgb,depth"]), "stills"),
            job("video", &render(&[]), "clip.mp4"),
            job("loop", &render(&[]), "clip.webp"),
            job("sheet", &render(&["--format", "sheet"]), "sheet.png"),
            job("sequence", &export("ply-seq"), "frames"),
            job("archive", &export("zip"), "frames.zip"),
            job("clip", &export("splat4d"), "clip.splat4d"),
            job("page", &export("html"), "page.html"),
            job("snapshot", &["export", &run, "--to", "spz"], "frame.spz"),
            job("demo", &["demo", "--splats", "1000", "--frames", "2", "-g", "cpu"], "demo"),
        ]
    }

    /// The `c4d` command of a job.
    pub(crate) fn command(&self, job: &Job, extra: &[&str]) -> std::process::Command {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("c4d"));
        command.args(&job.arguments).arg("-o").arg(self.at(job.output)).args(extra);
        command.env("NO_COLOR", "1").stdout(std::process::Stdio::null());
        command
    }

    /// Names in the folder.
    pub(crate) fn names(&self) -> Vec<String> {
        names(self.folder.path())
    }
}

/// Names in a folder, sorted, without records of written files.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !name.ends_with(".c4d-files"))
        .collect();
    names.sort();
    names
}

/// Every file of an output, with its content.
pub(crate) fn content(path: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut pending = vec![path.to_owned()];
    while let Some(next) = pending.pop() {
        if next.is_dir() {
            pending.extend(fs::read_dir(next).unwrap().map(|entry| entry.unwrap().path()));
        } else if next.exists() {
            found.insert(next.strip_prefix(path).unwrap().to_owned(), fs::read(&next).unwrap());
        }
    }
    found
}

/// Freezes the small model with view-dependent colours, and writes an edit of it that needs
/// refinement.
pub(crate) fn recoloured(model: &Path, folder: &Path) -> PathBuf {
    let (frozen, edited) = (folder.join("frozen-model"), folder.join("recoloured.ply"));
    success(&mut c4d([Path::new("freeze"), model, Path::new("-o"), &frozen]));
    let mut splats = ply::read_file(&frozen.join("point_cloud.ply")).unwrap().splats;
    for i in 0..splats.len() {
        if splats.means[i][2] > 0.0 {
            splats.means[i][0] *= 1.02;
            splats.sh[i * 16] = [1.0, -0.5, 0.2];
            splats.sh[i * 16 + 1..(i + 1) * 16].fill([0.0; 3]);
        }
    }
    ply::write_file(&edited, &splats, &ply::WriteOptions::default(), Existing::Refuse).unwrap();
    edited
}
