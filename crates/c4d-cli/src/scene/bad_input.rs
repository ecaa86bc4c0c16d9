//! [`bad_input`]: what to do about an input that cannot be read.

use crate::failure::{Failure, chain};
use gs_io::cameras::CamerasError;
use gs_io::frame::FrameError;
use gs_io::{IoError, SceneKind};

/// What an edited frame may be.
const FRAMES: &str = "c4d goes by a file's content, not by the end of its name: export the splats as 3DGS PLY, compressed PLY, .splat, .spz, .sog or .glb.";

/// Converts a reader's error; its message names the file and what was found.
pub(crate) fn bad_input(error: &IoError) -> Failure {
    let failure = Failure::bad_input(chain(error));
    match error {
        IoError::Read { .. } => {
            failure.next("Check the name, and that it is a file that can be read.")
        }
        IoError::Damaged { .. } => {
            failure.next("Without --strict such rows are dropped and counted.")
        }
        IoError::StandIn { found, .. } => failure.next(found.next),
        IoError::Frame { path, source: FrameError::Unknown { .. } } => {
            match gs_io::detect(path) {
                Ok(SceneKind::Unsupported(format)) => failure.next(format.next),
                _ => failure.next(FRAMES),
            }
        }
        IoError::Frame { source: FrameError::Version { .. }, .. } => failure.next(
            "Convert it as above, or export the splats as a 3DGS PLY from the program that made it.",
        ),
        IoError::Cameras { source: CamerasError::Lens { .. }, .. } => failure.next(
            "Undistort the images, and give the folder that this writes; or give other cameras.",
        ),
        IoError::Ply { .. } | IoError::Frame { .. } => {
            failure.next("Copy the file again, or export the splats again as a 3DGS PLY.")
        }
        IoError::Splatv { .. } | IoError::Splat4d { .. } => {
            failure.next("Copy or export the clip again, or give the scene it was made from.")
        }
        IoError::Cameras { .. } => failure.next(
            "Write the file anew, or give other cameras: c4d info PATH says what a file or folder has.",
        ),
        _ => failure,
    }
}
