//! [`bad_input`]: errors of inputs with the next step.

use crate::failure::{Failure, MORE_MEMORY, chain, is_out_of_memory};
use gs_deform::FieldError;
use gs_io::cameras::CamerasError;
use gs_io::frame::FrameError;
use gs_io::ply::PlyError;
use gs_io::pth::PthError;
use gs_io::splat4d::Splat4dError;
use gs_io::splatv::SplatvError;
use gs_io::{IoError, SceneKind};
use std::path::Path;

/// Supported formats of an edited frame.
const FRAMES: &str = "Formats are recognised by content, not by file name. Export the splats as 3DGS PLY, compressed PLY, .splat, .spz, .sog or .glb.";

const FRAME_AGAIN: &str = "Copy the file again, or export the splats again as a 3DGS PLY.";

/// First words of next steps in messages of readers, after a semicolon.
const STEPS: [&str; 12] = [
    "choose", "convert", "copy", "export", "fetch", "make", "pass", "put", "save", "train", "use",
    "write",
];

/// Splits a message into what happened and the next step, if it ends with one.
fn split_step(message: &str) -> Option<(&str, String)> {
    let (what, step) = message.rsplit_once("; ")?;
    let first = step.split(' ').next()?;
    STEPS.contains(&first).then(|| {
        let (head, rest) = step.split_at(1);
        (what, format!("{}{rest}.", head.to_uppercase()))
    })
}

/// Converts a reader's error, whose message names the file and what was found.
pub(crate) fn bad_input(error: &IoError) -> Failure {
    let message = chain(error);
    let failure = match split_step(&message) {
        Some((what, step)) => Failure::bad_input(what).next(step),
        None => Failure::bad_input(&message),
    };
    match error {
        _ if is_out_of_memory(error) => Failure::failed(chain(error)).next(MORE_MEMORY),
        IoError::Read { .. } => {
            failure.next("Check that the name is right and that the file is readable.")
        }
        IoError::Damaged { source, .. } if source.report.damaged() == source.report.rows => failure
            .next(
                "Export the splats again, or use an earlier file from the program that made them.",
            ),
        IoError::Damaged { .. } => {
            failure.next("Without --strict such rows are dropped and counted.")
        }
        IoError::StandIn { found, .. } => failure.next(found.next),
        IoError::Format { path, .. } => match step_for_format(error, path) {
            Some(step) => failure.next(step),
            None => failure,
        },
        _ => failure,
    }
}

/// The next step after an error of the format of the file `path`, unless its message ends with one.
fn step_for_format(error: &IoError, path: &Path) -> Option<&'static str> {
    if let Some(error) = error.cause::<FrameError>() {
        return Some(match error {
            FrameError::Unknown { .. } => match gs_io::detect(path) {
                Ok(SceneKind::Unsupported(format)) => format.next,
                _ => FRAMES,
            },
            error if error.is_unsupported_version() => {
                "Convert it as above, or export the splats as a 3DGS PLY from the program that made it."
            }
            _ => FRAME_AGAIN,
        });
    }
    if error.cause::<PlyError>().is_some() {
        return Some(FRAME_AGAIN);
    }
    if let Some(error) = error.cause::<CamerasError>() {
        return Some(match error {
            CamerasError::Lens { .. } => {
                "Undistort the images and use the resulting folder, or use different cameras."
            }
            _ => {
                "Export the file again, or use different cameras; c4d info PATH shows what a file or folder contains."
            }
        });
    }
    if error.cause::<PthError>().is_some() {
        return Some(
            "Copy the file again from the machine that trained the model; c4d info PATH shows what a file or folder contains.",
        );
    }
    if error.cause::<SplatvError>().is_some() || error.cause::<Splat4dError>().is_some() {
        return Some("Copy or export the clip again, or use the scene from which it was made.");
    }
    match error.cause::<FieldError>()? {
        FieldError::NotFinite { .. } => Some(
            "Use an earlier iteration of the model: training that diverges writes such values.",
        ),
        FieldError::Shape { .. } => Some(
            "Copy the model again from the machine that trained it: its files must be from the same training run and iteration.",
        ),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn next_steps_at_the_end_of_messages_are_found() {
        let (what, step) =
            split_step("a.pth: is cut short; copy it again, a; b").unwrap_or_default();
        assert_eq!((what, step.as_str()), ("", ""), "the last clause is no step");
        let (what, step) = split_step("a.pth: is cut short; it is empty; copy it again").unwrap();
        assert_eq!(what, "a.pth: is cut short; it is empty", "the rest");
        assert_eq!(step, "Copy it again.", "a sentence");
        assert_eq!(split_step("expected one; found two"), None, "no step");
        assert_eq!(split_step(""), None, "nothing");
    }
}
