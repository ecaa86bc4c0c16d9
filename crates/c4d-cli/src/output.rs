//! Outputs of commands: what may be in their place, and what failures mean.

use crate::args::Global;
use crate::failure::{Failure, Outcome, ROOM, chain};
use gs_io::{Existing, IoError};
use std::path::{Path, PathBuf};

/// What happens to output that is already there.
pub(crate) fn existing(global: &Global) -> Existing {
    if global.overwrite { Existing::Replace } else { Existing::Refuse }
}

/// Failure to write output; refusing to overwrite is a matter of usage.
pub(crate) fn output_failure(error: &IoError) -> Failure {
    let text = chain(error);
    match error {
        IoError::Exists { path } => Failure::usage(format!("{} already exists", path.display()))
            .next("Choose another name; -w replaces what c4d wrote."),
        IoError::NotOurs { path, entry, .. } => Failure::usage(text).next(format!(
            "Move {} elsewhere, or choose another name for the output.",
            path.join(entry).display()
        )),
        IoError::Taken { next, .. } => Failure::usage(text).next(next),
        IoError::Busy { .. } => {
            Failure::usage(text).next("Wait for it to end, or choose another name for the output.")
        }
        IoError::Content { .. } => Failure::usage(text),
        IoError::Scene { source, .. } => Failure::bad_input(chain(source)),
        IoError::Write { .. } => Failure::failed(text).next(ROOM),
        _ => Failure::failed(text),
    }
}

/// Refuses an output that is, holds, or lies in one of the inputs: writing it would destroy them.
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
            .next("Choose another output; inputs are never overwritten."));
        }
    }
    Ok(())
}

/// The path with links resolved; of a path that does not exist yet, its nearest existing folder
/// resolved.
fn real(path: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(path).ok()?;
    absolute.ancestors().find_map(|ancestor| {
        let rest = absolute.strip_prefix(ancestor).ok()?;
        Some(ancestor.canonicalize().ok()?.join(rest))
    })
}

/// Refuses SH degrees that the scene does not have.
pub(crate) fn check_sh_degree(asked: Option<usize>, available: usize) -> Outcome {
    match asked {
        Some(degree) if degree > available => Err(Failure::usage(format!(
            "--sh-degree {degree}: the scene has SH degree {available}"
        ))),
        _ => Ok(()),
    }
}
