//! Why a player could not be made.

use gs_core::SceneError;
use thiserror::Error;

/// Most frames of one payload.
pub const MAX_FRAMES: usize = 65_535;

/// Why a player could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlayerError {
    /// There is nothing to play.
    #[error("player: no frames were asked for, expected at least 1")]
    NoFrames,
    /// More frames than the format counts.
    #[error("player: {found} frames, expected at most {MAX_FRAMES}")]
    TooManyFrames {
        /// Requested frames.
        found: usize,
    },
    /// No splat of either scene can ever be seen.
    #[error(
        "player: none of the {rows} splats can be seen: {not_finite} are damaged, the others never reach an opacity of 1/255"
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
        /// What was given.
        found: String,
        /// What is possible.
        expected: &'static str,
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
    /// A scene changed its number of rows between frames.
    #[error("player: the scene has {found} splats at time {time}, expected {expected}")]
    Rows {
        /// The time.
        time: f32,
        /// Rows then.
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
