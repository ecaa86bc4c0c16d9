//! Parts of the program that a build may leave out.

use crate::args::Format;
use crate::failure::{Failure, Outcome};

/// Refuses a format whose writer this build lacks.
pub(crate) fn check_format(format: Format) -> Outcome {
    match format {
        Format::Mp4 if cfg!(not(feature = "mp4")) => Err(missing("mp4", "--format gif needs none")),
        Format::Webp if cfg!(not(feature = "webp")) => {
            Err(missing("webp", "--format gif needs none"))
        }
        Format::Exr if cfg!(not(feature = "exr")) => Err(missing("exr", "--format npy needs none")),
        _ => Ok(()),
    }
}

/// Failure for a Cargo feature that this build lacks; `instead` says what works without it.
pub(crate) fn missing(feature: &str, instead: &str) -> Failure {
    Failure::usage(format!("this c4d was built without the feature `{feature}`")).next(format!(
        "{instead}; builds with `--features {feature}`, a default feature, include it."
    ))
}

/// The features that this build has.
pub(crate) fn built_with() -> Vec<&'static str> {
    [
        ("exr", cfg!(feature = "exr")),
        ("gpu", cfg!(feature = "gpu")),
        ("mp4", cfg!(feature = "mp4")),
        ("webp", cfg!(feature = "webp")),
    ]
    .into_iter()
    .filter_map(|(name, built)| built.then_some(name))
    .collect()
}
