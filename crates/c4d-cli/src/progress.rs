//! Progress of a stage: a bar on a terminal, else a line every few seconds.

use crate::observer::{Observer, stop_if_cancelled};
use crate::rates::rounded;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt;
use std::fmt::Write as _;
use std::io::Write;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between progress lines.
const LINE_INTERVAL: Duration = Duration::from_secs(5);
/// Time between two redraws of a bar whose stage does not advance.
const REDRAW_INTERVAL: Duration = Duration::from_millis(500);

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shown {
    Nowhere,
    Bar,
    Lines,
}

/// Number of finished steps of a stage.
#[derive(Debug)]
struct Tally {
    stage: String,
    done: AtomicU64,
    total: u64,
    /// Whether steps are only hundredths of the stage.
    percent: bool,
    message: Mutex<String>,
    start: Instant,
}

impl Tally {
    /// `render: 12 of 60, 3.4 per second, 14 s left`; before the first step, the elapsed time.
    fn line(&self) -> String {
        let done = self.done.load(Ordering::Relaxed).min(self.total);
        let elapsed = self.start.elapsed().as_secs_f64();
        let mut line = format!("{}: ", self.stage);
        if !self.percent {
            let _ = write!(line, "{done} of {}, ", self.total);
        } else if done > 0 {
            let _ = write!(line, "{done} %, ");
        }
        if done == 0 {
            let _ = write!(line, "running for {}", time(elapsed));
        } else {
            let rate = done as f64 / elapsed.max(1e-9);
            if !self.percent {
                let _ = write!(line, "{} per second, ", rounded(rate));
            }
            let _ = write!(line, "{} left", time((self.total - done) as f64 / rate));
        }
        if let Ok(message) = self.message.lock()
            && !message.is_empty()
        {
            let _ = write!(line, ", {message}");
        }
        line
    }
}

/// A duration as text: `14 s`, `3 min 20 s`, `2 h 5 min`.
fn time(secs: f64) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let secs = secs.round() as u64;
    match secs {
        0..60 => format!("{secs} s"),
        60..3600 => format!("{} min {} s", secs / 60, secs % 60),
        _ => format!("{} h {} min", secs / 3600, secs / 60 % 60),
    }
}

/// A running stage. When it is dropped, its bar or lines end.
#[derive(Debug)]
pub(crate) struct StageProgress {
    tally: Arc<Tally>,
    bar: Option<ProgressBar>,
    lines: Option<Lines>,
    observer: Option<Arc<dyn Observer>>,
}

/// The thread that prints lines; it ends when the sender is dropped.
#[derive(Debug)]
struct Lines {
    ends: Option<Sender<()>>,
    writer: Option<JoinHandle<()>>,
}

impl Lines {
    fn start(tally: &Arc<Tally>, interval: Duration) -> Self {
        let (ends, ended) = mpsc::channel::<()>();
        let tally = Arc::clone(tally);
        let writer = std::thread::spawn(move || {
            while ended.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
                let _ = writeln!(std::io::stderr().lock(), "{}", tally.line());
            }
        });
        Self { ends: Some(ends), writer: Some(writer) }
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        drop(self.ends.take());
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

impl StageProgress {
    /// A stage of `total` equal steps; with `percent`, of hundredths.
    pub(crate) fn new(shown: Shown, stage: &str, total: u64, percent: bool) -> Self {
        let tally = Arc::new(Tally {
            stage: stage.to_owned(),
            done: AtomicU64::new(0),
            total,
            percent,
            message: Mutex::default(),
            start: Instant::now(),
        });
        let bar = (shown == Shown::Bar).then(|| bar(stage, total, percent));
        let lines = (shown == Shown::Lines).then(|| Lines::start(&tally, LINE_INTERVAL));
        Self { tally, bar, lines, observer: None }
    }

    /// Reports to an observer.
    pub(crate) fn observed(mut self, observer: Option<Arc<dyn Observer>>) -> Self {
        self.observer = observer;
        self.report(0);
        self
    }

    fn report(&self, done: u64) {
        if let Some(observer) = &self.observer {
            observer.progress(&self.tally.stage, done.min(self.tally.total), self.tally.total);
            stop_if_cancelled(observer.as_ref());
        }
    }

    /// Advances by one step.
    pub(crate) fn step(&mut self) {
        self.set(self.tally.done.load(Ordering::Relaxed) + 1);
    }

    /// `done` steps of the total are finished.
    pub(crate) fn set(&mut self, done: u64) {
        self.tally.done.store(done, Ordering::Relaxed);
        if let Some(bar) = &self.bar {
            bar.set_position(done);
        }
        self.report(done);
    }

    /// Text next to the bar.
    pub(crate) fn message(&self, text: impl fmt::Display) {
        let text = text.to_string();
        if let Some(bar) = &self.bar {
            bar.set_message(text.clone());
        }
        if let Ok(mut message) = self.tally.message.lock() {
            *message = text;
        }
    }

    /// Ends the stage and clears its bar.
    pub(crate) fn finish(self) -> Duration {
        self.tally.start.elapsed()
    }
}

impl Drop for StageProgress {
    fn drop(&mut self) {
        drop(self.lines.take());
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn bar(stage: &str, total: u64, percent: bool) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
    let template = if percent {
        "{prefix:>12} [{bar:30}] {percent:>3} %  {left}  {msg}"
    } else {
        "{prefix:>12} [{bar:30}] {pos}/{len}  {rate}  {left}  {msg}"
    };
    let rate = |state: &ProgressState, out: &mut dyn fmt::Write| {
        let _ = write!(out, "{}/s", rounded(state.per_sec()));
    };
    let left = |state: &ProgressState, out: &mut dyn fmt::Write| {
        let _ = if state.pos() == 0 {
            write!(out, "{} so far", time(state.elapsed().as_secs_f64()))
        } else {
            write!(out, "{} left", time(state.eta().as_secs_f64()))
        };
    };
    let style = ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .with_key("rate", rate)
        .with_key("left", left);
    bar.set_style(style);
    bar.set_prefix(stage.to_owned());
    bar.enable_steady_tick(REDRAW_INTERVAL);
    bar
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(done: u64, total: u64, percent: bool, secs: u64) -> Tally {
        Tally {
            stage: "render".to_owned(),
            done: AtomicU64::new(done),
            total,
            percent,
            message: Mutex::default(),
            start: Instant::now().checked_sub(Duration::from_secs(secs)).unwrap(),
        }
    }

    #[test]
    fn lines_have_rounded_rates_and_the_remaining_time() {
        let line = |done, total, percent, secs| tally(done, total, percent, secs).line();
        assert_eq!(line(12, 60, false, 4), "render: 12 of 60, 3 per second, 16 s left", "steps");
        assert_eq!(line(1, 1000, false, 3), "render: 1 of 1000, 0.33 per second, 49 min 57 s left");
        assert_eq!(line(0, 60, false, 70), "render: 0 of 60, running for 1 min 10 s", "none yet");
        assert_eq!(line(25, 100, true, 5), "render: 25 %, 15 s left", "hundredths");
        assert_eq!(line(0, 100, true, 5), "render: running for 5 s", "no hundredth yet");
        assert_eq!(line(70, 60, false, 7), "render: 60 of 60, 8.57 per second, 0 s left", "beyond");
    }
}
