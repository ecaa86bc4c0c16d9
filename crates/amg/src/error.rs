//! Errors of this crate.

use gs_core::{SceneError, SplatsError};
use thiserror::Error;

/// Error of estimating or evaluating a motion. Numerical problems are not errors; they are counted
/// in [`crate::MotionReport`].
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum AmgError {
    /// The source scene failed to evaluate.
    #[error("amg: the source scene could not be evaluated")]
    Source(#[from] SceneError),
    /// Arrays of the edited splats, or of the source's splats, have inconsistent lengths.
    #[error("amg: {which} splats are malformed")]
    Shape {
        /// "edited" or "source".
        which: &'static str,
        /// Error of the array.
        #[source]
        source: SplatsError,
    },
    /// An option has a value outside its range.
    #[error("amg: option `{name}` is {found}, expected {expected}")]
    Option {
        /// Path of the field.
        name: &'static str,
        /// Its value.
        found: String,
        /// Accepted range.
        expected: &'static str,
    },
    /// The scene's mask does not have one entry per source splat.
    #[error("amg: the dynamic mask has {found} entries, expected one per source splat, {expected}")]
    Mask {
        /// Its length.
        found: usize,
        /// Number of source splats.
        expected: usize,
    },
    /// The arrays of a binding are inconsistent with each other, the source scene or the edited
    /// splats.
    #[error("amg: binding: {what}")]
    Binding {
        /// Description: the array and row, the expected and the found value.
        what: String,
    },
    /// Anchors could not be built.
    #[error("amg: anchors could not be built")]
    Anchors(#[from] anchors::AnchorError),
    /// The transport problem is invalid.
    #[error("amg: transport could not be solved")]
    Transport(#[from] uot::UotError),
}
