//! [`FourdgsError`]: errors of reading a `.4dgs` file.

use thiserror::Error;

/// Error of reading a `.4dgs` file.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FourdgsError {
    /// The container is damaged.
    #[error("is a damaged .4dgs: {0}; copy or export it again")]
    Damaged(String),
    /// A different temporal model.
    #[error(
        "is a .4dgs of the temporal model `{found}`, expected `{expected}`; write it with that, or export the scene as a PLY sequence from the program that made it"
    )]
    TemporalModel {
        /// The model found.
        found: String,
        /// The supported model.
        expected: &'static str,
    },
    /// No splats.
    #[error("contains no splats; export it again with at least one splat")]
    Empty,
    /// More splats than the file can contain.
    #[error("declares {rows} splats in {bytes} bytes; copy it again")]
    Rows {
        /// Number declared.
        rows: u64,
        /// Size of the file.
        bytes: usize,
    },
    /// The duration is not a positive number.
    #[error("lasts {seconds} seconds, expected a positive number; export it again")]
    Duration {
        /// The duration found.
        seconds: f64,
    },
    /// Objects move along tracks.
    #[error(
        "moves objects along tracks, which is not supported; export the scene as a PLY sequence from the program that made it"
    )]
    Tracks,
}
