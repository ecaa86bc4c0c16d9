//! [`Gaussian4dError`]: errors of reading a checkpoint of native 4D Gaussians.

use crate::pth::LayersError;
use thiserror::Error;

/// Error of reading a checkpoint of native 4D Gaussians.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Gaussian4dError {
    /// A part is missing, has a different shape, or is of a different method.
    #[error("{0}")]
    Parameters(String),
    /// A tensor is missing.
    #[error("{0}")]
    Layers(#[from] LayersError),
    /// A checkpoint of 3D Gaussians, which do not move.
    #[error(
        "is a checkpoint of 3D Gaussians without times, which do not move; use the \
        point_cloud.ply of the model as a frame"
    )]
    Still,
    /// No Gaussians.
    #[error("holds no Gaussians")]
    Empty,
    /// No time range was given.
    #[error(
        "contains native 4D Gaussians, and no file states their time range; pass --set \
        time_duration=START,END as in the training's configuration (0,10 for Neural 3D Video, 0,1 \
        for D-NeRF): the splats' own times range from {first:.2} to {last:.2}"
    )]
    UnknownTimes {
        /// Earliest time of a splat, in the unit of training.
        first: f64,
        /// Latest time of a splat.
        last: f64,
    },
    /// The time range given is empty or not finite.
    #[error("time_duration={start},{end}: expected two numbers, the second larger")]
    TimeRange {
        /// Its start.
        start: f64,
        /// Its end.
        end: f64,
    },
}
