//! Errors of this crate.

use gs_core::{CameraError, RasterError, SplatsError};
use thiserror::Error;

/// A parse error. Displayed as three lines: what was expected, the text, and a caret below the
/// column.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{what} (column {column})\n    {text}\n    {:>column$}", '^')]
pub struct SyntaxError {
    /// The whole text, control characters replaced by spaces.
    pub text: String,
    /// Column of the error in `text`, from 1; one past the last character if the text ends too
    /// early.
    pub column: usize,
    /// Expected and found text.
    pub what: String,
}

impl SyntaxError {
    /// An error at character `at` (from 0) of `text`.
    pub(crate) fn new(text: &str, at: usize, what: impl Into<String>) -> Self {
        let text = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        Self { text, column: at + 1, what: what.into() }
    }
}

/// Error of a step.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EditError {
    /// An expression or the argument of an action is malformed.
    #[error("`--{option}`: {source}")]
    Syntax {
        /// Name of the option, without dashes.
        option: String,
        /// Column and reason.
        #[source]
        source: SyntaxError,
    },
    /// No action has this name.
    #[error("unknown action `{0}`")]
    UnknownAction(String),
    /// A modifier does not follow the action it modifies.
    #[error("`--{modifier}` must directly follow `--{action}`")]
    Modifier {
        /// Name of the modifier, without dashes.
        modifier: &'static str,
        /// Name of the action that it modifies.
        action: &'static str,
    },
    /// The selection of an action is empty.
    #[error("`--{action}` has no selected splats: {why}")]
    EmptySelection {
        /// Name of the action.
        action: &'static str,
        /// Reason why the selection is empty.
        why: String,
    },
    /// The action would remove all splats.
    #[error("`--{0}` would leave no splats")]
    NothingLeft(&'static str),
    /// Values overflow single precision.
    #[error("`--{action}` makes `{field}` of splat {row} too large for single precision")]
    NotFinite {
        /// Name of the action.
        action: &'static str,
        /// Array of [`gs_core::Splats`].
        field: &'static str,
        /// Row at this step.
        row: usize,
    },
    /// A list contains a row that does not exist.
    #[error("`ids {file}`: splat {id} does not exist, the frame has {num_splats} (0 to {last})", last = num_splats.saturating_sub(1))]
    Id {
        /// Name of the list.
        file: String,
        /// The row in the list.
        id: u64,
        /// Number of splats of the input.
        num_splats: usize,
    },
    /// The scene has no part with this number.
    #[error("`part {part}`: {}", found(*num_parts))]
    Part {
        /// Requested number.
        part: u32,
        /// Number of parts.
        num_parts: u32,
    },
    /// A file named in a step was not loaded ([`crate::ResourceNames`] lists them).
    #[error("{kind} `{name}` was not loaded")]
    Missing {
        /// "mask", "ids", "image", "splats" or "motion".
        kind: &'static str,
        /// Name as written in the step.
        name: String,
    },
    /// A picture has no pixel with colour.
    #[error("`{0}` has no visible pixels from which to take colours")]
    EmptyImage(String),
    /// The style transfer failed.
    #[error("`--style {name}`: {source}")]
    Style {
        /// Name of the picture.
        name: String,
        /// Error of the [`crate::StyleTransfer`].
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Arrays of the splats have inconsistent lengths.
    #[error(transparent)]
    Splats(#[from] SplatsError),
    /// A camera or mask is invalid.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The rasteriser failed.
    #[error(transparent)]
    Raster(#[from] RasterError),
}

fn found(num_parts: u32) -> String {
    match num_parts {
        0 => "the scene has no moving parts".to_owned(),
        1 => "the scene has one part, 1".to_owned(),
        n => format!("the scene has parts 1 to {n}"),
    }
}
