//! [`PlayerError`]: errors of making a player.

use gs_core::SceneError;
use thiserror::Error;

/// Largest number of frames of a payload.
pub const MAX_FRAMES: usize = 65_535;

/// Error of making a player.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlayerError {
    /// No frames were requested.
    #[error("player: no frames were requested, expected at least 1")]
    NoFrames,
    /// More frames than the format allows.
    #[error("player: {found} frames, expected at most {MAX_FRAMES}")]
    TooManyFrames {
        /// Number of requested frames.
        found: usize,
    },
    /// No splat of either scene is visible at any time.
    #[error(
        "player: none of the {rows} splats is visible: {not_finite} have invalid values, the \
        others have opacities below 1/255"
    )]
    NothingVisible {
        /// Rows of all scenes.
        rows: usize,
        /// Rows that are not finite, or have a zero quaternion, in some frame.
        not_finite: usize,
    },
    /// An option is out of range.
    #[error("player: `{name}` is {found}, expected {expected}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// The value given.
        found: String,
        /// The valid values.
        expected: &'static str,
    },
    /// An overlay does not fit the scenes or its palette.
    #[error("player: overlay `{name}`: {what}")]
    Overlay {
        /// Name of the overlay.
        name: String,
        /// Description of the mismatch.
        what: String,
    },
    /// A scene could not be evaluated at one of the times.
    #[error("player: scene at time {time}")]
    Scene {
        /// The time.
        time: f32,
        /// The cause.
        #[source]
        source: SceneError,
    },
    /// The number of rows of a scene changed between frames.
    #[error("player: the scene has {found} splats at time {time}, expected {expected}")]
    Rows {
        /// The time.
        time: f32,
        /// Rows at that time.
        found: usize,
        /// Rows of the first frame.
        expected: usize,
    },
    /// The page's configuration could not be written as JSON.
    #[error("player: the page's configuration cannot be written")]
    Json(#[from] serde_json::Error),
    /// Compression failed.
    #[error("player: the payload cannot be compressed")]
    Compress(#[from] std::io::Error),
}
