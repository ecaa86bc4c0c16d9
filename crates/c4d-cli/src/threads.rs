//! [`start_threads`]: the thread pool of the process.

use crate::failure::{Failure, Outcome};
use std::sync::Mutex;

/// Largest accepted number of threads; more are assumed to be a typing error.
const MAX_THREADS: usize = 1024;

/// Number of threads of the pool, once it runs.
static STARTED: Mutex<Option<usize>> = Mutex::new(None);

/// Starts the thread pool of the process with `threads` threads, or one per core. A pool that runs
/// already is kept.
///
/// # Errors
/// If the number is out of range or differs from that of the running pool, or the threads cannot
/// be started.
pub fn start_threads(threads: Option<usize>) -> Outcome {
    if let Some(threads) = threads.filter(|threads| !(1..=MAX_THREADS).contains(threads)) {
        return Err(Failure::usage(format!("--threads {threads}: expected 1 to {MAX_THREADS}")));
    }
    let mut started = STARTED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    match (*started, threads) {
        (Some(running), Some(requested)) if requested != running => Err(Failure::usage(format!(
            "--threads {requested}: the thread pool of this process already runs with {running}"
        ))
        .next("Set the number in the first call of the process, or start a new process.")),
        (Some(_), _) => Ok(()),
        (None, _) => {
            // Started here, where a failure is an error; at first use it would be a panic.
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads.unwrap_or(0))
                .build_global()
                .map_err(|error| {
                    Failure::failed(format!("cannot start the threads: {error}"))
                        .next("Use a smaller --threads, or allow the process more memory.")
                })?;
            *started = Some(rayon::current_num_threads());
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_many_threads_are_refused() {
        for threads in [0, MAX_THREADS + 1] {
            let failure = start_threads(Some(threads)).unwrap_err();
            assert!(failure.to_string().contains("expected 1 to 1024"), "{failure}");
        }
    }
}
