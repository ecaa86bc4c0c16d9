//! Outputs of commands: treatment of existing ones, and errors.

use crate::args::Global;
use crate::failure::{Failure, Outcome, ROOM, chain};
use gs_io::{Existing, IoError};
use std::path::{Path, PathBuf};

/// Treatment of existing output.
pub(crate) fn existing(global: &Global) -> Existing {
    if global.overwrite { Existing::Replace } else { Existing::Refuse }
}

/// Failure to write output; a refusal to overwrite is a usage error.
pub(crate) fn output_failure(error: &IoError) -> Failure {
    let text = chain(error);
    match error {
        IoError::Exists { path } => Failure::usage(format!("{} already exists", path.display()))
            .next("Choose a different name; -w replaces what c4d wrote."),
        IoError::UnrecordedEntry { path, entry, .. } => Failure::usage(text).next(format!(
            "Move {} elsewhere, or choose a different name for the output.",
            path.join(entry).display()
        )),
        IoError::Taken { next, .. } => Failure::usage(text).next(next),
        IoError::Busy { .. } => Failure::usage(text)
            .next("Wait for it to end, or choose a different name for the output."),
        IoError::Content { .. } => Failure::usage(text),
        IoError::Scene { source, .. } => Failure::bad_input(chain(source)),
        IoError::Write { .. } => Failure::failed(text).next(ROOM),
        _ => Failure::failed(text),
    }
}

/// Refuses an output that is, contains, or is inside one of the
/// inputs, because writing it would destroy them.
pub(crate) fn refuse_overlap(output: &Path, inputs: &[PathBuf]) -> Outcome {
    let Some(output_real) = real(output) else { return Ok(()) };
    for input in inputs {
        let Some(input_real) = real(input) else { continue };
        if output_real.starts_with(&input_real) || input_real.starts_with(&output_real) {
            return Err(Failure::usage(format!(
                "the output {} and the input {} overlap",
                output.display(),
                input.display()
            ))
            .next("Choose a different output; inputs are never overwritten."));
        }
    }
    Ok(())
}

/// The path with links resolved; for a path that does not exist yet,
/// with its nearest existing folder resolved.
fn real(path: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(path).ok()?;
    absolute.ancestors().find_map(|ancestor| {
        let rest = absolute.strip_prefix(ancestor).ok()?;
        Some(ancestor.canonicalize().ok()?.join(rest))
    })
}

/// Refuses SH degrees that the scene does not have.
pub(crate) fn check_sh_degree(requested: Option<usize>, available: usize) -> Outcome {
    match requested {
        Some(degree) if degree > available => Err(Failure::usage(format!(
            "--sh-degree {degree}: the scene has SH degree {available}"
        ))),
        _ => Ok(()),
    }
}
