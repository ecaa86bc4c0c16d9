//! Output to the terminal: results on standard output;
//! progress, notes and warnings on standard error.

use crate::progress::{Shown, StageProgress};
use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The user's terminal.
#[derive(Debug)]
pub(crate) struct Console {
    quiet: bool,
    verbose: bool,
    bars: bool,
    warnings: AtomicUsize,
}

impl Console {
    /// If `progress` is false, bars and progress lines are off;
    /// `quiet` prints only warnings and errors.
    pub(crate) fn new(quiet: bool, verbose: bool, progress: bool) -> Self {
        Self { quiet, verbose, bars: progress && !quiet, warnings: AtomicUsize::new(0) }
    }

    /// A result, on standard output. A closed pipe is not an error.
    #[expect(clippy::unused_self, reason = "the console decides where results are printed")]
    pub(crate) fn result(&self, text: impl Display) {
        let _ = writeln!(std::io::stdout().lock(), "{text}");
    }

    /// A note on the current work, on standard error.
    pub(crate) fn note(&self, text: impl Display) {
        if !self.quiet {
            let _ = writeln!(std::io::stderr().lock(), "{text}");
        }
    }

    /// Detail for `--verbose`.
    pub(crate) fn detail(&self, text: impl Display) {
        if self.verbose {
            self.note(text);
        }
    }

    /// A warning; counted for `--strict`.
    pub(crate) fn warn(&self, text: impl Display) {
        self.warnings.fetch_add(1, Ordering::Relaxed);
        let _ = writeln!(std::io::stderr().lock(), "warning: {text}");
    }

    /// Number of warnings so far.
    pub(crate) fn warnings(&self) -> usize {
        self.warnings.load(Ordering::Relaxed)
    }

    /// Progress of `total` equal steps.
    pub(crate) fn progress(&self, stage: &str, total: u64) -> StageProgress {
        StageProgress::new(self.shown(), stage, total, false)
    }

    /// Progress of a stage in hundredths.
    pub(crate) fn percent(&self, stage: &str) -> StageProgress {
        StageProgress::new(self.shown(), stage, 100, true)
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
