//! Output to the terminal (results on standard output; progress, notes and warnings on standard
//! error) or to an observer.

use crate::failure::{Exit, Failure};
use crate::json_report::JsonReport;
use crate::observer::{MessageKind, Observer, stop_if_cancelled};
use crate::progress::{Shown, StageProgress};
use serde_json::Value;
use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The user's terminal, or an observer instead.
#[derive(Debug)]
pub(crate) struct Console {
    quiet: bool,
    verbose: bool,
    bars: bool,
    warnings: AtomicUsize,
    observer: Option<Arc<dyn Observer>>,
    json: Option<JsonReport>,
}

impl Console {
    /// If `progress` is false, bars and progress lines are off;
    /// `quiet` prints only warnings and errors.
    pub(crate) fn new(quiet: bool, verbose: bool, progress: bool) -> Self {
        let warnings = AtomicUsize::new(0);
        Self { quiet, verbose, bars: progress && !quiet, warnings, observer: None, json: None }
    }

    /// Prints nothing; all output goes to the observer.
    pub(crate) fn observed(observer: Arc<dyn Observer>) -> Self {
        Self { observer: Some(observer), ..Self::new(false, true, false) }
    }

    /// For a command that is one step of this one: only its warnings appear.
    pub(crate) fn of_step(&self) -> Self {
        Self::observed(Arc::new(Step(self.observer.clone())))
    }

    /// With `--json`, results are one object, printed by [`Console::end`].
    #[must_use]
    pub(crate) fn json(mut self, json: bool) -> Self {
        self.json = json.then(JsonReport::default);
        self
    }

    /// Prints the object of `--json`.
    pub(crate) fn end(&self, failure: Option<&Failure>) {
        if let Some(json) = &self.json {
            self.print(&serde_json::to_string_pretty(&json.document(failure)).unwrap_or_default());
        }
    }

    /// Prints on standard output.
    fn print(&self, text: &str) {
        match &self.observer {
            Some(observer) => observer.message(MessageKind::Result, text),
            None => {
                let _ = writeln!(std::io::stdout().lock(), "{text}");
            }
        }
    }

    /// Results of the command, for `--json`.
    pub(crate) fn report(&self, keys: impl FnOnce() -> Value) {
        if let Some(json) = &self.json {
            json.report(keys());
        }
    }

    /// A file or folder that was written in addition to the results; only listed by `--json`.
    pub(crate) fn wrote(&self, path: &Path) {
        if let Some(json) = &self.json {
            json.output(path, &[]);
        }
    }

    /// A result: a file or folder that was written, with counts of its contents.
    pub(crate) fn output(&self, path: &Path, counts: &[(&str, usize)]) {
        if let Some(json) = &self.json {
            json.output(path, counts);
        }
        let counts: Vec<_> = counts.iter().map(|(name, count)| format!("{count} {name}")).collect();
        let counts =
            if counts.is_empty() { String::new() } else { format!(" ({})", counts.join(", ")) };
        self.result(format!("{}{counts}", path.display()));
    }

    /// A result, on standard output. A closed pipe is not an error. Not printed with `--json`.
    pub(crate) fn result(&self, text: impl Display) {
        if self.json.is_none() {
            self.print(&text.to_string());
        }
    }

    /// A note on the current work, on standard error.
    pub(crate) fn note(&self, text: impl Display) {
        self.keep("note", &text);
        match &self.observer {
            Some(observer) => {
                stop_if_cancelled(observer.as_ref());
                observer.message(MessageKind::Note, &text.to_string());
            }
            None if !self.quiet => {
                let _ = writeln!(std::io::stderr().lock(), "{text}");
            }
            None => {}
        }
    }

    /// Detail for `--verbose`.
    pub(crate) fn detail(&self, text: impl Display) {
        match &self.observer {
            Some(observer) => {
                stop_if_cancelled(observer.as_ref());
                observer.message(MessageKind::Detail, &text.to_string());
            }
            None if self.verbose => self.note(text),
            None => {}
        }
    }

    /// A warning; counted for `--strict`.
    pub(crate) fn warn(&self, text: impl Display) {
        self.warnings.fetch_add(1, Ordering::Relaxed);
        self.keep("warning", &text);
        match &self.observer {
            Some(observer) => observer.message(MessageKind::Warning, &text.to_string()),
            None => {
                let _ = writeln!(std::io::stderr().lock(), "warning: {text}");
            }
        }
    }

    /// Stores a message for `--json`.
    fn keep(&self, kind: &str, text: &impl Display) {
        if let Some(json) = &self.json {
            json.message(kind, &text.to_string());
        }
    }

    /// Number of warnings so far.
    pub(crate) fn warnings(&self) -> usize {
        self.warnings.load(Ordering::Relaxed)
    }

    /// The failure of a command that finished with warnings under `--strict`.
    pub(crate) fn strict_failure(&self) -> Failure {
        let what = format!("finished with {} warnings (--strict)", self.warnings());
        Failure { exit: Exit::Warnings, what, next: None }
    }

    /// Progress of `total` equal steps.
    pub(crate) fn progress(&self, stage: &str, total: u64) -> StageProgress {
        StageProgress::new(self.shown(), stage, total, false).observed(self.observer.clone())
    }

    /// Progress of a stage in hundredths.
    pub(crate) fn percent(&self, stage: &str) -> StageProgress {
        StageProgress::new(self.shown(), stage, 100, true).observed(self.observer.clone())
    }

    fn shown(&self) -> Shown {
        if !self.bars {
            Shown::Nowhere
        } else if std::io::stderr().is_terminal() && !is_dumb() {
            Shown::Bar
        } else {
            Shown::Lines
        }
    }
}

/// Receives the messages of a step; the observer is that of the whole command.
#[derive(Debug)]
struct Step(Option<Arc<dyn Observer>>);

impl Observer for Step {
    fn message(&self, kind: MessageKind, text: &str) {
        match &self.0 {
            _ if kind != MessageKind::Warning => {}
            Some(observer) => observer.message(kind, text),
            None => {
                let _ = writeln!(std::io::stderr().lock(), "warning: {text}");
            }
        }
    }

    fn progress(&self, _stage: &str, _done: u64, _total: u64) {}

    fn is_cancelled(&self) -> bool {
        self.0.as_ref().is_some_and(|observer| observer.is_cancelled())
    }
}

/// Whether the terminal cannot move its cursor (`TERM=dumb`), such as the shell of an editor.
fn is_dumb() -> bool {
    std::env::var_os("TERM").is_some_and(|name| name == "dumb")
}
