//! [`Observer`]: messages and progress of a command that runs inside another program.

use std::any::Any;
use std::fmt;

/// Kinds of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageKind {
    /// A result: what the program prints on standard output.
    Result,
    /// A note on the current work.
    Note,
    /// A detail that the program prints with `--verbose`.
    Detail,
    /// A warning.
    Warning,
}

/// Receives messages and progress. Called from several threads.
pub trait Observer: fmt::Debug + Send + Sync {
    /// A message, without a final line break.
    fn message(&self, kind: MessageKind, text: &str);

    /// `done` of `total` steps of a stage are finished.
    fn progress(&self, stage: &str, done: u64, total: u64);

    /// Whether the command should stop. Checked with every report of progress; the command then
    /// ends, without partial output, as if it had been interrupted.
    fn is_cancelled(&self) -> bool;
}

/// Payload of the unwinding that ends a cancelled command.
struct Cancelled;

/// Ends the command by unwinding, which removes unfinished output, if the observer cancelled it.
pub(crate) fn stop_if_cancelled(observer: &dyn Observer) {
    if observer.is_cancelled() {
        std::panic::resume_unwind(Box::new(Cancelled));
    }
}

/// Whether the payload of a caught unwinding is that of a cancelled command.
pub(crate) fn is_cancellation(payload: &(dyn Any + Send)) -> bool {
    payload.is::<Cancelled>()
}
