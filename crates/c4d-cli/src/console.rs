//! Output to the terminal: results on standard output;
//! progress, notes and warnings on standard error. Or all of it to an observer.

use crate::failure::{Exit, Failure};
use crate::observer::{MessageKind, Observer, stop_if_cancelled};
use crate::progress::{Shown, StageProgress};
use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The user's terminal, or the observer in its place.
#[derive(Debug)]
pub(crate) struct Console {
    quiet: bool,
    verbose: bool,
    bars: bool,
    warnings: AtomicUsize,
    observer: Option<Arc<dyn Observer>>,
}

impl Console {
    /// If `progress` is false, bars and progress lines are off;
    /// `quiet` prints only warnings and errors.
    pub(crate) fn new(quiet: bool, verbose: bool, progress: bool) -> Self {
        let warnings = AtomicUsize::new(0);
        Self { quiet, verbose, bars: progress && !quiet, warnings, observer: None }
    }

    /// Prints nothing; the observer gets everything.
    pub(crate) fn observed(observer: Arc<dyn Observer>) -> Self {
        Self { observer: Some(observer), ..Self::new(false, true, false) }
    }

    /// A result, on standard output. A closed pipe is not an error.
    pub(crate) fn result(&self, text: impl Display) {
        match &self.observer {
            Some(observer) => observer.message(MessageKind::Result, &text.to_string()),
            None => {
                let _ = writeln!(std::io::stdout().lock(), "{text}");
            }
        }
    }

    /// A note on the current work, on standard error.
    pub(crate) fn note(&self, text: impl Display) {
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
        match &self.observer {
            Some(observer) => observer.message(MessageKind::Warning, &text.to_string()),
            None => {
                let _ = writeln!(std::io::stderr().lock(), "warning: {text}");
            }
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

/// Whether the terminal cannot move its cursor (`TERM=dumb`), such as the shell of an editor.
fn is_dumb() -> bool {
    std::env::var_os("TERM").is_some_and(|name| name == "dumb")
}
