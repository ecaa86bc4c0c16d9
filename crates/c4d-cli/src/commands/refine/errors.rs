//! Errors of a refinement: of its flags before it begins, and of its work.

use super::task::{MIN_MEMORY, chosen};
use crate::args::{Global, PresetArg, RefineFlags};
use crate::device::{self, Device};
use crate::failure::{Failure, Outcome, chain};
use crate::run_folder::REFINE_STATE;
use crate::settings::RefineSettings;
use crate::{memory, scene};
use cuar::CuarError;
use gs_io::cameras::Reading;
use std::path::Path;

/// Largest accepted number of images.
const MAX_SAMPLES: usize = 10_000_000;

/// Checks the flags, cameras and device of a refinement before anything else is done.
pub(crate) fn check(
    flags: &RefineFlags,
    preset: PresetArg,
    settings: &RefineSettings,
    global: &Global,
) -> Outcome {
    let refuse = |what: String| Err(Failure::usage(what));
    if let Some(frames) = flags.refine_frames.filter(|frames| !(1..=10_000).contains(frames)) {
        return refuse(format!("--refine-frames {frames}: expected 1 to 10000"));
    }
    if let Some(samples) = flags.samples.filter(|samples| !(1..=MAX_SAMPLES).contains(samples)) {
        return refuse(format!("--samples {samples}: expected 1 to {MAX_SAMPLES}"));
    }
    if let Some(epsilon) = flags.epsilon
        && !(0.0..=10.0).contains(&epsilon)
    {
        return refuse(format!("--epsilon {epsilon}: expected 0 to 10; the paper uses 0.5 to 2"));
    }
    let intervals = [
        ("--preview-every", flags.preview_every),
        ("--checkpoint-every", Some(flags.checkpoint_every)),
    ];
    for (name, seconds) in intervals {
        if let Some(seconds) = seconds.filter(|secs| !(*secs >= 0.0 && secs.is_finite())) {
            return refuse(format!("{name} {seconds}: expected seconds, 0 or more"));
        }
    }
    if flags.refine_cameras.is_some() && flags.refine_up.is_some() {
        return refuse(
            "--refine-up applies to the rig only; the cameras of --refine-cameras have their own poses".to_owned(),
        );
    }
    chosen(flags, preset, settings)?.check().map_err(|error| settings.refused(&error))?;
    if let Some(requested) = flags.memory {
        if requested < MIN_MEMORY {
            return refuse(format!("--memory {requested}: expected MiB, {MIN_MEMORY} or more"));
        }
        memory::require(
            &format!("--memory {requested}"),
            (requested as u64).saturating_mul(memory::MIB),
            "Use a smaller value: images that do not fit are rendered again, or fewer are used.",
        )?;
    }
    if let Some(path) = &flags.refine_cameras {
        gs_io::cameras::open(path, Reading::Trained).map_err(|error| scene::bad_input(&error))?;
    }
    Device::open(global.gpu).map(|_| ())
}

/// An error of the refinement; `failure` is the error because of which its observer stopped it, if
/// any.
pub(super) fn failed(run: &Path, failure: Option<Failure>, error: CuarError) -> Failure {
    match (failure, error) {
        (Some(failure), CuarError::Cancelled { .. }) => failure,
        (_, CuarError::Raster(error)) => {
            let failure = device::failure(&error);
            Failure { what: format!("{}: {}", run.display(), failure.what), ..failure }
        }
        (_, error @ CuarError::State { .. }) => Failure::bad_input(format!(
            "{}: {}",
            run.join(REFINE_STATE).display(),
            chain(&error)
        ))
        .next("The run or its source has changed: omit --resume to start the refinement again."),
        (_, error) => Failure::failed(format!("{}: {}", run.display(), chain(&error))),
    }
}
