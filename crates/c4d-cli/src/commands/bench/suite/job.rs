//! [`Job`]: one edit of one scene with one method.

use super::file::{EditEntry, MethodEntry, SceneEntry, Suite};
use crate::args::{Cli, Command, Global};
use crate::commands::{eval, propagate};
use crate::console::Console;
use crate::evaluation::Item;
use crate::failure::{Failure, Outcome};
use crate::output::{existing, output_failure};
use crate::run_folder::fingerprint;
use gs_io::AtomicDir;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Names of the run, the metrics and the record of inputs in the folder of a completed job.
const RUN: &str = "run";
const METRICS: &str = "metrics.json";
const JOB: &str = "job.json";

pub(super) struct Job<'a> {
    scene: &'a SceneEntry,
    edit: &'a EditEntry,
    method: &'a MethodEntry,
    /// Flags of `c4d eval` for every run.
    eval: &'a [String],
    folder: PathBuf,
}

/// A job with its metrics.
pub(super) struct Measured {
    pub(super) scene: String,
    pub(super) edit: String,
    pub(super) method: String,
    pub(super) items: Vec<Item>,
}

impl Measured {
    /// The values, by metric id.
    pub(super) fn json(&self) -> Value {
        let values =
            self.items.iter().map(|item| (item.definition.id.to_owned(), json!(item.value)));
        json!({
            "scene": self.scene,
            "edit": self.edit,
            "method": self.method,
            "values": values.collect::<serde_json::Map<_, _>>(),
        })
    }
}

impl<'a> Job<'a> {
    /// All jobs; checks all flags before the first one starts.
    pub(super) fn all(suite: &'a Suite, output: &Path) -> Outcome<Vec<Self>> {
        let mut jobs = Vec::new();
        for scene in &suite.scenes {
            for edit in &scene.edits {
                for method in &suite.methods {
                    let folder = output.join(&scene.name).join(&edit.name).join(&method.name);
                    let job = Self { scene, edit, method, eval: &suite.eval, folder };
                    let named = |failure: Failure| Failure {
                        what: format!("{}: {}", job.name(), failure.what),
                        ..failure
                    };
                    parse(&job.propagation(Path::new(RUN))).map_err(named)?;
                    parse(&job.measurement(Path::new(RUN), Path::new(METRICS))).map_err(named)?;
                    jobs.push(job);
                }
            }
        }
        Ok(jobs)
    }

    pub(super) fn name(&self) -> String {
        format!("{}/{}/{}", self.scene.name, self.edit.name, self.method.name)
    }

    /// Arguments of `c4d propagate`.
    fn propagation(&self, run: &Path) -> Vec<OsString> {
        let fixed = ["propagate".into(), self.scene.path.clone().into_os_string()];
        let flags = self.scene.flags.iter().chain(&self.edit.flags).chain(&self.method.flags);
        let named = ["--edited".into(), self.edit.edited.clone().into_os_string()];
        let output = ["-o".into(), run.as_os_str().to_owned()];
        fixed.into_iter().chain(flags.map(OsString::from)).chain(named).chain(output).collect()
    }

    /// Arguments of `c4d eval`.
    fn measurement(&self, run: &Path, metrics: &Path) -> Vec<OsString> {
        let fixed = ["eval".into(), run.as_os_str().to_owned()];
        let flags = self.eval.iter().chain(&self.scene.eval).map(OsString::from);
        let truth = self.edit.truth.iter().flat_map(|truth| ["--truth".into(), truth.into()]);
        let output = ["-o".into(), metrics.as_os_str().to_owned()];
        fixed.into_iter().chain(flags).chain(truth).chain(output).collect()
    }

    /// Everything on which the result depends.
    fn record(&self) -> Outcome<Value> {
        let words = |words: Vec<OsString>| -> Vec<String> {
            words.iter().map(|word| word.to_string_lossy().into_owned()).collect()
        };
        let truth = self.edit.truth.as_deref().map(content).transpose()?;
        Ok(json!({
            "version": env!("CARGO_PKG_VERSION"),
            "scene": content(&self.scene.path)?,
            "edited": content(&self.edit.edited)?,
            "truth": truth,
            "propagate": words(self.propagation(Path::new(RUN))),
            "eval": words(self.measurement(Path::new(RUN), Path::new(METRICS))),
        }))
    }

    /// The metrics from an earlier call; `None` if the job must run.
    pub(super) fn completed(&self, global: &Global) -> Outcome<Option<Measured>> {
        if !self.folder.exists() {
            return Ok(None);
        }
        let stored: Option<Value> = read_json(&self.folder.join(JOB));
        let same = stored.as_ref().zip(self.record().ok()).is_some_and(|(a, b)| *a == b);
        if same && let Some(measured) = self.measured(&self.folder) {
            return Ok(Some(measured));
        }
        if global.overwrite {
            return Ok(None);
        }
        let what = if stored.is_some() {
            "was computed from different inputs or flags"
        } else {
            "is not a run of this suite"
        };
        Err(Failure::usage(format!("{} {what}", self.folder.display()))
            .next("-w computes such runs again; a different -o keeps them."))
    }

    /// Propagates and measures.
    pub(super) fn run(&self, global: &Global, console: &Console) -> Outcome<Measured> {
        if let Some(parent) = self.folder.parent() {
            std::fs::create_dir_all(parent).map_err(|error| Failure::write(parent, &error))?;
        }
        let record = self.record()?;
        let folder = AtomicDir::create(&self.folder, existing(global))
            .map_err(|error| output_failure(&error))?;
        let (run, metrics) = (folder.path().join(RUN), folder.path().join(METRICS));
        let (cli, own) = parse(&self.propagation(&run))?;
        if let Command::Propagate(args) = &cli.command {
            propagate::run(args, &own, console)?;
        }
        let (cli, own) = parse(&self.measurement(&run, &metrics))?;
        if let Command::Eval(args) = &cli.command {
            eval::run(args, &own, console)?;
        }
        let measured = self.measured(folder.path()).ok_or_else(|| {
            Failure::failed(format!("{}: c4d eval wrote no numbers", self.name()))
        })?;
        let path = folder.path().join(JOB);
        let text = serde_json::to_string_pretty(&record).map_err(Failure::failed)?;
        std::fs::write(&path, text).map_err(|error| Failure::write(&path, &error))?;
        folder.commit().map_err(|error| output_failure(&error))?;
        Ok(measured)
    }

    /// The metrics of a completed job.
    fn measured(&self, folder: &Path) -> Option<Measured> {
        let document = read_json(&folder.join(METRICS))?;
        let views = document["views"].as_array()?.len();
        let items = document["items"].as_array()?.iter();
        Some(Measured {
            scene: self.scene.name.clone(),
            edit: self.edit.name.clone(),
            method: self.method.name.clone(),
            items: items.map(|item| Item::of_json(item, views)).collect::<Option<_>>()?,
        })
    }
}

/// Parses the arguments of a command.
fn parse(arguments: &[OsString]) -> Outcome<(Cli, Global)> {
    let cli = Cli::of(arguments)?;
    if !matches!(cli.command, Command::Propagate(_) | Command::Eval(_)) {
        return Err(Failure::usage("the flags name a different command"));
    }
    let global = cli.global();
    Ok((cli, global))
}

/// Fingerprint of a file, or of all files below a folder.
fn content(path: &Path) -> Outcome<String> {
    let mut files = Vec::new();
    list(path, &mut files)
        .map_err(|error| Failure::bad_input(format!("cannot read {}: {error}", path.display())))?;
    fingerprint(&files)
}

/// The files at or below `path`, ordered by name.
fn list(path: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if !std::fs::metadata(path)?.is_dir() {
        files.push(path.to_owned());
        return Ok(());
    }
    let mut entries: Vec<_> = std::fs::read_dir(path)?.collect::<std::io::Result<_>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    entries.iter().try_for_each(|entry| list(&entry.path(), files))
}

fn read_json(path: &Path) -> Option<Value> {
    serde_json::from_slice(&gs_io::read_file(path).ok()?).ok()
}
