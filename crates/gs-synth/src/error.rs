//! [`SynthError`].

use gs_core::SceneError;
use thiserror::Error;

/// Error of generating a scene, an edit or a score.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SynthError {
    /// A parameter is out of range.
    #[error("gs-synth: `{name}` is {found}, expected {expected}")]
    Param {
        /// The parameter.
        name: &'static str,
        /// Its value.
        found: String,
        /// The allowed range.
        expected: &'static str,
    },
    /// An edit needs a body part the scene does not have.
    #[error("gs-synth: {edit} needs a figure, but this scene has none")]
    NoFigure {
        /// The edit.
        edit: &'static str,
    },
    /// Unknown truth case.
    #[error("gs-synth: unknown truth case `{0}`")]
    UnknownCase(String),
    /// The number of splats of the prediction differs from the truth.
    #[error("gs-synth: the predicted scene has {found} splats, the truth has {expected}")]
    Count {
        /// Splats predicted.
        found: usize,
        /// Splats of the truth.
        expected: usize,
    },
    /// A scene could not be evaluated.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A fitted network is invalid.
    #[error(transparent)]
    Field(#[from] gs_deform::FieldError),
}

impl SynthError {
    pub(crate) fn param(
        name: &'static str,
        found: impl std::fmt::Display,
        expected: &'static str,
    ) -> Self {
        Self::Param { name, found: found.to_string(), expected }
    }
}
