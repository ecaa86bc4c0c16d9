//! Optional parts of the program.

use crate::failure::Failure;

/// Failure for a Cargo feature that this build lacks; `instead` states what works without it.
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
