//! What the user reads while `c4d` works: results on standard output; progress, notes and warnings on standard error.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Seconds between lines of progress when standard error is no terminal.
const PLAIN_INTERVAL: Duration = Duration::from_secs(10);

/// The user's terminal.
#[derive(Debug)]
pub(crate) struct Console {
    quiet: bool,
    verbose: bool,
    bars: bool,
    warnings: AtomicUsize,
}

impl Console {
    /// `progress` off silences bars and progress lines, `quiet` all but warnings and errors.
    pub(crate) fn new(quiet: bool, verbose: bool, progress: bool) -> Self {
        Self { quiet, verbose, bars: progress && !quiet, warnings: AtomicUsize::new(0) }
    }

    /// A result, on standard output. A closed pipe is not an error.
    #[expect(clippy::unused_self, reason = "where results go is the console's business")]
    pub(crate) fn result(&self, text: impl Display) {
        let _ = writeln!(std::io::stdout().lock(), "{text}");
    }

    /// What is being done, on standard error.
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

    /// Something the user should know; counted for `--strict`.
    pub(crate) fn warn(&self, text: impl Display) {
        self.warnings.fetch_add(1, Ordering::Relaxed);
        let _ = writeln!(std::io::stderr().lock(), "warning: {text}");
    }

    /// Warnings so far.
    pub(crate) fn warnings(&self) -> usize {
        self.warnings.load(Ordering::Relaxed)
    }

    /// Progress of `total` equal steps.
    pub(crate) fn progress(&self, stage: &str, total: u64) -> Progress {
        let terminal = std::io::stderr().is_terminal();
        let bar = if self.bars && terminal {
            let bar = ProgressBar::new(total);
            let style = ProgressStyle::with_template(
                "{prefix:>12} [{bar:30}] {pos}/{len}  {per_sec}  ETA {eta}  {msg}",
            );
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_prefix(stage.to_owned());
            bar
        } else {
            ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden())
        };
        let now = Instant::now();
        Progress {
            bar,
            plain: self.bars && !terminal,
            stage: stage.to_owned(),
            total,
            start: now,
            last_line: now,
        }
    }
}

/// A running stage.
#[derive(Debug)]
pub(crate) struct Progress {
    bar: ProgressBar,
    plain: bool,
    stage: String,
    total: u64,
    start: Instant,
    last_line: Instant,
}

impl Progress {
    /// One step further.
    pub(crate) fn step(&mut self) {
        self.set(self.bar.position() + 1);
    }

    /// `done` steps of the total are finished.
    pub(crate) fn set(&mut self, done: u64) {
        self.bar.set_position(done);
        if self.plain && done > 0 && self.last_line.elapsed() >= PLAIN_INTERVAL {
            self.last_line = Instant::now();
            let elapsed = self.start.elapsed().as_secs_f64();
            let left = elapsed / done as f64 * self.total.saturating_sub(done) as f64;
            let _ = writeln!(
                std::io::stderr().lock(),
                "{}: {done}/{}, {:.1}/s, ETA {left:.0} s",
                self.stage,
                self.total,
                done as f64 / elapsed.max(1e-9),
            );
        }
    }

    /// Text beside the bar.
    pub(crate) fn message(&self, text: impl Display) {
        self.bar.set_message(text.to_string());
    }

    /// Ends the stage and clears its bar.
    pub(crate) fn finish(self) -> Duration {
        self.bar.finish_and_clear();
        self.start.elapsed()
    }
}
