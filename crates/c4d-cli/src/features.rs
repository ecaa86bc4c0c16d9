//! Parts of the program that a build may leave out.

/// A Cargo feature that this build lacks.
///
/// # Errors
/// Always: says which feature is missing, and how to get it.
#[cfg(not(all(feature = "exr", feature = "gpu", feature = "mp4", feature = "webp")))]
pub(crate) fn missing(
    feature: &str,
    instead: &str,
) -> crate::failure::Outcome<std::convert::Infallible> {
    let what = format!("this c4d was built without the feature `{feature}`");
    let next = format!("{instead}; c4d built with `--features {feature}`, a default, has it.");
    Err(crate::failure::Failure::usage(what).next(next))
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
