//! [`Failure`]: an error with its location and next step, and the exit code for scripts.

use std::fmt;
use std::path::Path;

/// Exit codes of `c4d`, the same for every command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Any failure without its own code.
    Failed = 1,
    /// The command line is invalid or inconsistent.
    Usage = 2,
    /// An input file is missing, malformed or of a different kind.
    BadInput = 3,
    /// No usable GPU although one was requested.
    NoGpu = 4,
    /// Finished, but with warnings, under `--strict`.
    Warnings = 6,
    /// Stopped by the user.
    Interrupted = 130,
}

/// Next step if output cannot be written.
pub(crate) const ROOM: &str =
    "Check that the folder exists, is writable, and that the disk has space.";

/// Next step if memory is insufficient.
pub(crate) const MORE_MEMORY: &str =
    "Close other programs, raise the limit of this process, or use a machine with more memory.";

impl Exit {
    /// The general next step for failures without their own.
    fn next(self) -> &'static str {
        match self {
            Self::Usage => "c4d COMMAND --help lists the flags and their values.",
            Self::BadInput => {
                "c4d info PATH shows what a file or folder contains and what is missing."
            }
            Self::NoGpu => "c4d doctor lists the adapters; --gpu cpu works everywhere.",
            Self::Failed | Self::Warnings | Self::Interrupted => {
                "c4d doctor checks this machine; -v shows more details."
            }
        }
    }
}

/// An error as shown to the user.
#[derive(Debug)]
pub struct Failure {
    /// Code for scripts.
    pub exit: Exit,
    /// What happened, where, what was expected and found.
    pub what: String,
    /// The next step; a general hint if `None`.
    pub next: Option<String>,
}

/// Result of a command.
pub type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    /// Exit code 1.
    pub(crate) fn failed(what: impl fmt::Display) -> Self {
        Self { exit: Exit::Failed, what: what.to_string(), next: None }
    }

    /// Exit code 2.
    pub(crate) fn usage(what: impl fmt::Display) -> Self {
        Self { exit: Exit::Usage, what: what.to_string(), next: None }
    }

    /// Exit code 3.
    pub(crate) fn bad_input(what: impl fmt::Display) -> Self {
        Self { exit: Exit::BadInput, what: what.to_string(), next: None }
    }

    /// Exit code 3 for an error about inputs, with its sources; exit code 1 if memory ran out.
    pub(crate) fn input(error: impl std::error::Error + 'static) -> Self {
        let what = chain(&error);
        if is_out_of_memory(&error) {
            Self::failed(what).next(MORE_MEMORY)
        } else {
            Self::bad_input(what)
        }
    }

    /// Exit code 1 for a file that could not be written.
    pub(crate) fn write(path: &Path, error: &dyn std::error::Error) -> Self {
        let path = gs_io::final_path(path);
        Self::failed(format!("cannot write {}: {}", path.display(), chain(error))).next(ROOM)
    }

    /// Exit code 130.
    pub(crate) fn interrupted() -> Self {
        let what = "interrupted; no partial output remains".to_owned();
        Self { exit: Exit::Interrupted, what, next: None }
    }

    /// The next step, or the general one of the exit code.
    pub fn next_step(&self) -> &str {
        self.next.as_deref().unwrap_or(self.exit.next())
    }

    /// Adds the next step.
    #[must_use]
    pub(crate) fn next(mut self, step: impl fmt::Display) -> Self {
        self.next = Some(step.to_string());
        self
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}\n  next: {}", self.what, self.next_step())
    }
}

/// Whether an error or one of its sources is a failed allocation.
pub(crate) fn is_out_of_memory(error: &(dyn std::error::Error + 'static)) -> bool {
    std::iter::successors(Some(error), |error| error.source())
        .filter_map(|error| error.downcast_ref::<std::io::Error>())
        .any(|error| error.kind() == std::io::ErrorKind::OutOfMemory)
}

/// An error and its sources on one line, without repeating parts that a message already contains.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        let cause_text = cause.to_string();
        if !text.contains(&cause_text) {
            text.push_str(": ");
            text.push_str(&cause_text);
        }
        source = cause.source();
    }
    text
}
