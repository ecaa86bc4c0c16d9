//! [`supervise`]: runs work on a separate thread, so that Python stays responsive.

use crate::failures::exception;
use c4d_cli::{MessageKind, Observer};
use pyo3::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

/// Interval between checks for signals while no messages arrive.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Stack size of the worker thread, bytes; equals that of the main thread on Linux.
const STACK_BYTES: usize = 8 << 20;

/// Python callables for messages, `(kind, text)`, and progress, `(stage, done, total)`.
#[derive(Debug, Default)]
pub(crate) struct Callbacks {
    pub(crate) on_message: Option<Py<PyAny>>,
    pub(crate) on_progress: Option<Py<PyAny>>,
}

impl Callbacks {
    fn deliver(&self, py: Python<'_>, event: Event) -> PyResult<()> {
        match (event, &self.on_message, &self.on_progress) {
            (Event::Message(kind, text), Some(callback), _) => {
                callback.call1(py, (name(kind), text)).map(drop)
            }
            (Event::Progress(stage, done, total), _, Some(callback)) => {
                callback.call1(py, (stage, done, total)).map(drop)
            }
            _ => Ok(()),
        }
    }
}

fn name(kind: MessageKind) -> &'static str {
    match kind {
        MessageKind::Result => "result",
        MessageKind::Note => "note",
        MessageKind::Detail => "detail",
        MessageKind::Warning => "warning",
    }
}

/// Treatment of the work if the caller is interrupted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Interrupted {
    /// The work is cancelled and joined, because it writes files.
    Stops,
    /// The work continues in the background and its result is dropped; it has no side effects.
    IsAbandoned,
}

enum Event {
    Message(MessageKind, String),
    Progress(String, u64, u64),
    Ended,
}

/// Sends messages and progress to the calling thread.
#[derive(Debug)]
struct Relay {
    events: Sender<Event>,
    cancelled: Arc<AtomicBool>,
}

impl Observer for Relay {
    fn message(&self, kind: MessageKind, text: &str) {
        let _ = self.events.send(Event::Message(kind, text.to_owned()));
    }

    fn progress(&self, stage: &str, done: u64, total: u64) {
        let _ = self.events.send(Event::Progress(stage.to_owned(), done, total));
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// As [`supervise`], for a computation without side effects; starts the thread pool.
///
/// # Errors
/// As [`supervise`], and if the threads cannot be started.
pub(crate) fn compute<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    c4d_cli::start_threads(None).map_err(|failure| exception(py, &failure))?;
    supervise(py, &Callbacks::default(), Interrupted::IsAbandoned, move |_| work())
}

/// Runs `work` on a separate thread without the interpreter's lock and returns its result.
/// Meanwhile, this thread handles signals and calls the callbacks.
///
/// # Errors
/// `KeyboardInterrupt`, or the exception of a callback.
pub(crate) fn supervise<T: Send + 'static>(
    py: Python<'_>,
    callbacks: &Callbacks,
    interrupted: Interrupted,
    work: impl FnOnce(&Arc<dyn Observer>) -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, mut events) = mpsc::channel();
    let cancelled = Arc::new(AtomicBool::new(false));
    let relay = Relay { events: sender.clone(), cancelled: Arc::clone(&cancelled) };
    let worker = thread::Builder::new().stack_size(STACK_BYTES).spawn(move || {
        let observer: Arc<dyn Observer> = Arc::new(relay);
        let outcome = catch_unwind(AssertUnwindSafe(|| work(&observer)));
        let _ = sender.send(Event::Ended);
        outcome
    })?;
    let mut stopped = None;
    loop {
        let (received, kept) = py.detach(move || (events.recv_timeout(POLL_INTERVAL), events));
        events = kept;
        let delivered = match received {
            Ok(Event::Ended) | Err(RecvTimeoutError::Disconnected) => break,
            Ok(event) if stopped.is_none() => callbacks.deliver(py, event),
            Ok(_) | Err(RecvTimeoutError::Timeout) => Ok(()),
        };
        if let Err(error) = delivered.and_then(|()| py.check_signals()) {
            if interrupted == Interrupted::IsAbandoned {
                return Err(error);
            }
            cancelled.store(true, Ordering::Relaxed);
            stopped.get_or_insert(error);
        }
    }
    let outcome = py.detach(|| worker.join()).unwrap_or_else(|panic| resume_unwind(panic));
    let result = outcome.unwrap_or_else(|panic| resume_unwind(panic));
    match stopped {
        Some(error) => Err(error),
        None => Ok(result),
    }
}
