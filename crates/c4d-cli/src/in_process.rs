//! [`run_command`]: a command of `c4d` in this process.

use crate::args::Cli;
use crate::console::Console;
use crate::dispatch;
use crate::failure::{Failure, Outcome};
use crate::observer::{Observer, is_cancellation};
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;

/// Runs `c4d ARGUMENTS` (without the program's name) in this process. Nothing is printed; results,
/// messages and progress go to the observer.
///
/// # Errors
/// Every error that the program would print, with its exit code. This includes invalid arguments,
/// warnings under `--strict`, and cancellation by [`Observer::is_cancelled`].
pub fn run_command(arguments: &[OsString], observer: &Arc<dyn Observer>) -> Outcome {
    let cli = Cli::of(arguments)?;
    let global = &cli.global();
    let console = Console::observed(Arc::clone(observer)).json(global.json);
    cancellable(|| dispatch::run(&cli, global, &console))?;
    if global.strict && console.warnings() > 0 {
        return Err(console.strict_failure());
    }
    console.end(None);
    Ok(())
}

/// The outcome of `work`, or a failure if an observer cancelled it.
pub(crate) fn cancellable<T>(work: impl FnOnce() -> Outcome<T>) -> Outcome<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        if is_cancellation(payload.as_ref()) {
            return Err(Failure::interrupted());
        }
        resume_unwind(payload)
    })
}
